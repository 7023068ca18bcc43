"""`python -m mbsim`: the command line."""

from mbsim.cli.main import main

if __name__ == "__main__":
    main(prog_name="mbsim")
