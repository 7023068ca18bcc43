/* CFFSUB in C: the law of coulomb_stribeck.py.
 *
 * Linux:    gcc -O2 -shared -fPIC -o cffsub_c.so cffsub.c -lm
 * macOS:    clang -O2 -shared -o cffsub_c.dylib cffsub.c
 * Windows:  cl /O2 /LD cffsub.c  (cffsub.dll)
 *
 * Run:      mbsim run DECK.xml --plugin cffsub_c.so      or cff_dll_name="cffsub_c.so" in the deck
 *
 * cff_param_string = "USER(mu_static, mu_dynamic, stiction_velocity, friction_velocity)"
 *
 * All arguments come by address. loci, locj, x, xdot have 3 numbers, par has *npar, result takes
 * 3: Fx, Fy and the torque Tz on I, along the axes of the I incident marker. dflag is 1 where the
 * call is for derivatives. iflag is 1 in one call before all others, with zeros in place of
 * numbers; what that call returns is not looked at.
 */
#include <math.h>

#ifdef _WIN32
#define STDCALL __stdcall
#define EXPORT __declspec(dllexport)
#else
#define STDCALL
#define EXPORT
#endif

EXPORT void STDCALL CFFSUB(int *id, double *time, double *par, int *npar, double *loci,
                           double *locj, double *x, double *xdot, double *nforce, int *dflag,
                           int *iflag, double *result)
{
    double mu_static = par[0], mu_dynamic = par[1], vs = par[2], vd = par[3];
    double v = hypot(xdot[0], xdot[1]), ratio;

    (void)id, (void)time, (void)npar, (void)loci, (void)locj, (void)x, (void)dflag, (void)iflag;

    /* ratio is mu / v; below vs the STEP from (-vs, -mu_static) to (vs, mu_static), divided by v
     * on paper: nothing is divided by v where v may be 0 */
    if (v <= vs) {
        double u = v / vs;
        ratio = 0.5 * mu_static * (3.0 - u * u) / vs;
    } else if (v < vd) {
        double u = (v - vs) / (vd - vs);
        ratio = (mu_static + (mu_dynamic - mu_static) * u * u * (3.0 - 2.0 * u)) / v;
    } else {
        ratio = mu_dynamic / v;
    }
    result[0] = -ratio * *nforce * xdot[0];
    result[1] = -ratio * *nforce * xdot[1];
    result[2] = 0.0;
}
