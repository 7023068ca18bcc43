! CFFSUB in Fortran: the law of coulomb_stribeck.py.
!
! Linux:    gfortran -O2 -shared -fPIC -o cffsub_f.so cffsub.f90
! macOS:    gfortran -O2 -shared -o cffsub_f.dylib cffsub.f90
! Windows:  gfortran -O2 -shared -o cffsub_f.dll cffsub.f90
!
! Run:      mbsim run DECK.xml --plugin cffsub_f.so      or cff_dll_name="cffsub_f.so" in the deck
!
! cff_param_string = "USER(mu_static, mu_dynamic, stiction_velocity, friction_velocity)"
!
! RESULTS are Fx, Fy and the torque Tz on I, along the axes of the I incident marker. AREA is that
! of the contact patch, 0 for a point. DFLAG is true where the call is for derivatives. IFLAG is
! true in one call before all others, with zeros in place of numbers; what that call returns is
! not looked at. The library holds this as cffsub_, which is how mbsim knows it for Fortran.
subroutine cffsub(id, time, par, npar, loci, locj, x, xdot, nforce, area, dflag, iflag, results)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar), loci(3), locj(3), x(3), xdot(3), nforce, area
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: results(3)
    double precision :: mu_static, mu_dynamic, vs, vd, v, u, ratio

    mu_static = par(1)
    mu_dynamic = par(2)
    vs = par(3)
    vd = par(4)
    v = hypot(xdot(1), xdot(2))

    ! ratio is mu / v; below vs the STEP from (-vs, -mu_static) to (vs, mu_static), divided by v
    ! on paper: nothing is divided by v where v may be 0
    if (v <= vs) then
        u = v / vs
        ratio = 0.5d0 * mu_static * (3.0d0 - u * u) / vs
    else if (v < vd) then
        u = (v - vs) / (vd - vs)
        ratio = (mu_static + (mu_dynamic - mu_static) * u * u * (3.0d0 - 2.0d0 * u)) / v
    else
        ratio = mu_dynamic / v
    end if
    results(1) = -ratio * nforce * xdot(1)
    results(2) = -ratio * nforce * xdot(2)
    results(3) = 0.0d0
end subroutine cffsub
