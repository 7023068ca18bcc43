! CNFSUB in Fortran: the law of cnfsub.py.
!
! Linux:    gfortran -O2 -shared -fPIC -o cnfsub_f.so cnfsub.f90
! macOS:    gfortran -O2 -shared -o cnfsub_f.dylib cnfsub.f90
! Windows:  gfortran -O2 -shared -o cnfsub_f.dll cnfsub.f90
!
! Run:      cnf_type="USERCNF" cnf_dll_name="cnfsub_f.so" in the deck, or --plugin cnfsub_f.so
!
! cnf_param_string = "USER(stiffness, exponent, damping)"
!
! The arguments are those of cnfsub.c, with AREA, that of the contact patch (0 for a point), before
! DFLAG.
subroutine cnfsub(id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, area, &
                  dflag, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar), loci(3), ni(3), locj(3), nj(3)
    double precision, intent(in) :: gap, gapdot, gapdotdot, area
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: result

    if (gap >= 0.0d0) then
        result = 0.0d0
    else
        result = max(par(1) * (-gap)**par(2) * (1.0d0 - par(3) * gapdot), 0.0d0)
    end if
end subroutine cnfsub
