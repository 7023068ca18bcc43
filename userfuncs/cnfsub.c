/* CNFSUB in C: the law of cnfsub.py.
 *
 * Linux:    gcc -O2 -shared -fPIC -o cnfsub_c.so cnfsub.c -lm
 * macOS:    clang -O2 -shared -o cnfsub_c.dylib cnfsub.c
 * Windows:  cl /O2 /LD cnfsub.c  (cnfsub.dll)
 *
 * Run:      cnf_type="USERCNF" cnf_dll_name="cnfsub_c.so" in the deck, or --plugin cnfsub_c.so
 *
 * cnf_param_string = "USER(stiffness, exponent, damping)"
 *
 * loci and locj are the contact points from the origins of the graphics' reference markers, in
 * their axes; ni and nj the unit normals out of I and out of J, in the same axes. gap is below 0
 * where shapes overlap, gapdot below 0 where they approach; gapdotdot is 0. result takes the force
 * that pushes I and J apart.
 */
#include <math.h>

#ifdef _WIN32
#define STDCALL __stdcall
#define EXPORT __declspec(dllexport)
#else
#define STDCALL
#define EXPORT
#endif

EXPORT void STDCALL CNFSUB(int *id, double *time, double *par, int *npar, double *loci,
                           double *ni, double *locj, double *nj, double *gap, double *gapdot,
                           double *gapdotdot, int *dflag, int *iflag, double *result)
{
    double force;

    (void)id, (void)time, (void)npar, (void)loci, (void)ni, (void)locj, (void)nj;
    (void)gapdotdot, (void)dflag, (void)iflag;

    if (*gap >= 0.0) {
        *result = 0.0;
        return;
    }
    force = par[0] * pow(-*gap, par[1]) * (1.0 - par[2] * *gapdot);
    *result = force > 0.0 ? force : 0.0;
}
