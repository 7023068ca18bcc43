! What user subroutines in Fortran may ask of mbsim: SYSFNC, SYSARY, ERRMES and USRMES.
!
! Linux:    gfortran -O2 -shared -fPIC -o force.so USERFUNCS/mbsim_usersub.f90 force.f90
!
! USERFUNCS is what `python -m mbsim.plugins` prints. mbsim writes the addresses of the functions into
! `mbsim_table` when it has loaded the library. ERRFLG is false, or true where a function is not known
! or not allowed there; its value is 0 then.
module mbsim_usersub
    use iso_c_binding
    implicit none
    type, bind(c) :: functions
        type(c_funptr) :: sysfnc, sysary, errmes, usrmes, get_ncontacts, get_contact_post
    end type functions
    type(functions), bind(c, name="mbsim_table") :: table
    abstract interface
        subroutine one(name, ipar, nsize, state, errflg) bind(c)
            import
            character(kind=c_char), intent(in) :: name(*)
            integer(c_int), intent(in) :: ipar(*)
            integer(c_int), value :: nsize
            real(c_double), intent(out) :: state
            integer(c_int), intent(out) :: errflg
        end subroutine one
        subroutine several(name, ipar, nsize, states, nstates, errflg) bind(c)
            import
            character(kind=c_char), intent(in) :: name(*)
            integer(c_int), intent(in) :: ipar(*)
            integer(c_int), value :: nsize
            real(c_double), intent(out) :: states(*)
            integer(c_int), intent(out) :: nstates, errflg
        end subroutine several
        subroutine message(flag, text, id, kind) bind(c)
            import
            integer(c_int), value :: flag, id
            character(kind=c_char), intent(in) :: text(*), kind(*)
        end subroutine message
    end interface
end module mbsim_usersub

! One number: DX, VR, WZ, VARVAL, DIF and so on of the ids in IPAR(NSIZE).
subroutine sysfnc(fncnam, ipar, nsize, state, errflg)
    use mbsim_usersub
    implicit none
    character(len=*), intent(in) :: fncnam
    integer, intent(in) :: nsize, ipar(nsize)
    double precision, intent(out) :: state
    logical, intent(out) :: errflg
    procedure(one), pointer :: ask
    integer(c_int) :: flag
    call c_f_procpointer(table%sysfnc, ask)
    call ask(trim(fncnam)//c_null_char, ipar, nsize, state, flag)
    errflg = flag /= 0
end subroutine sysfnc

! Several: TDISP, RDISP, TVEL, RVEL, TACC, RACC, TFORCE, RFORCE give 3; DISP, VEL, ACC, FORCE 6.
subroutine sysary(fncnam, ipar, nsize, states, nstates, errflg)
    use mbsim_usersub
    implicit none
    character(len=*), intent(in) :: fncnam
    integer, intent(in) :: nsize, ipar(nsize)
    double precision, intent(out) :: states(*)
    integer, intent(out) :: nstates
    logical, intent(out) :: errflg
    procedure(several), pointer :: ask
    integer(c_int) :: flag
    call c_f_procpointer(table%sysary, ask)
    call ask(trim(fncnam)//c_null_char, ipar, nsize, states, nstates, flag)
    errflg = flag /= 0
end subroutine sysary

! Logs an error where ERRFLG is true; ENDFLG 'STOP' ends the run when the subroutine returns.
subroutine errmes(errflg, mesage, id, endflg)
    use mbsim_usersub
    implicit none
    logical, intent(in) :: errflg
    character(len=*), intent(in) :: mesage, endflg
    integer, intent(in) :: id
    procedure(message), pointer :: tell
    call c_f_procpointer(table%errmes, tell)
    call tell(merge(1, 0, errflg), trim(mesage)//c_null_char, id, trim(endflg)//c_null_char)
end subroutine errmes

! Logs a message where MSGFLG is true; MSGTYP is 'INFO' or 'WARN'.
subroutine usrmes(msgflg, mesage, id, msgtyp)
    use mbsim_usersub
    implicit none
    logical, intent(in) :: msgflg
    character(len=*), intent(in) :: mesage, msgtyp
    integer, intent(in) :: id
    procedure(message), pointer :: tell
    call c_f_procpointer(table%usrmes, tell)
    call tell(merge(1, 0, msgflg), trim(mesage)//c_null_char, id, trim(msgtyp)//c_null_char)
end subroutine usrmes
