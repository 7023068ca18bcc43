/* What user subroutines in C may ask of mbsim: c_sysfnc, c_sysary, c_errmes, c_usrmes and, in
 * CONTACTPOST, c_get_ncontacts and c_get_contact_post. Include it; nothing has to be linked.
 *
 * Linux:    gcc -O2 -shared -fPIC -I USERFUNCS -o force.so force.c
 * Windows:  cl /O2 /LD /I USERFUNCS force.c      (functions named by a deck: MBSIM_EXPORT)
 *
 * USERFUNCS is what `python -m mbsim.plugins` prints. mbsim writes the addresses of the functions
 * into `mbsim_table` when it has loaded the library.
 *
 * errflg is 0, or 1 where a function is not known or not allowed there; its value is 0 then.
 */
#ifndef MBSIM_USERSUB_H
#define MBSIM_USERSUB_H

#ifdef _WIN32
#define MBSIM_EXPORT __declspec(dllexport)
#define MBSIM_SHARED __declspec(dllexport) __declspec(selectany)
#else
#define MBSIM_EXPORT
/* one table, however many sources of a library include this */
#define MBSIM_SHARED __attribute__((weak, visibility("default")))
#endif
#define STDCALL

typedef struct {
    void (*sysfnc)(const char *name, const int *ipar, int nsize, double *state, int *errflg);
    void (*sysary)(const char *name, const int *ipar, int nsize, double *states, int *nstates,
                   int *errflg);
    void (*errmes)(int errflg, const char *message, int id, const char *endflg);
    void (*usrmes)(int msgflg, const char *message, int id, const char *msgtyp);
    void (*get_ncontacts)(int id, int i_gra_id, int j_gra_id, int *ncontacts, int *errflg);
    void (*get_contact_post)(int id, int i_gra_id, int j_gra_id, int index, double *values,
                             int *nvalues, int *errflg);
} mbsim_functions;

#ifdef __cplusplus
extern "C" {
#endif
MBSIM_SHARED mbsim_functions mbsim_table = {0, 0, 0, 0, 0, 0};
#ifdef __cplusplus
}
#endif

/* One number: DX, VR, WZ, VARVAL, DIF and so on of the ids (markers, elements) in ipar. */
static inline void c_sysfnc(const char *name, const int *ipar, int nsize, double *state,
                            int *errflg)
{
    mbsim_table.sysfnc(name, ipar, nsize, state, errflg);
}

/* Several: TDISP, RDISP, TVEL, RVEL, TACC, RACC, TFORCE, RFORCE give 3; DISP, VEL, ACC, FORCE 6. */
static inline void c_sysary(const char *name, const int *ipar, int nsize, double *states,
                            int *nstates, int *errflg)
{
    mbsim_table.sysary(name, ipar, nsize, states, nstates, errflg);
}

/* Logs an error where errflg is not 0; endflg "STOP" ends the run when the function returns. */
static inline void c_errmes(int errflg, const char *message, int id, const char *endflg)
{
    mbsim_table.errmes(errflg, message, id, endflg);
}

/* Logs a message where msgflg is not 0; msgtyp is "INFO" or "WARN". */
static inline void c_usrmes(int msgflg, const char *message, int id, const char *msgtyp)
{
    mbsim_table.usrmes(msgflg, message, id, msgtyp);
}

/* CONTACTPOST: how many points of contact two graphics have. */
static inline void c_get_ncontacts(int id, int i_gra_id, int j_gra_id, int *ncontacts,
                                   int *errflg)
{
    mbsim_table.get_ncontacts(id, i_gra_id, j_gra_id, ncontacts, errflg);
}

/* CONTACTPOST: numbers of a point, 1 to n: depth, point (3), normal (3), X (3), area; with index 0
 * of the element: force (3), torque (3), largest depth, largest slip speed. At most 11. */
static inline void c_get_contact_post(int id, int i_gra_id, int j_gra_id, int index,
                                      double *values, int *nvalues, int *errflg)
{
    mbsim_table.get_contact_post(id, i_gra_id, j_gra_id, index, values, nvalues, errflg);
}

#endif
