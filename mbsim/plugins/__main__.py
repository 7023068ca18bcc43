"""`python -m mbsim.plugins`: the folder with mbsim_usersub.h and mbsim_usersub.f90."""

from mbsim.plugins.source.find import usersub_folder

if __name__ == "__main__":
    print(usersub_folder())  # noqa: T201  this is what it is for
