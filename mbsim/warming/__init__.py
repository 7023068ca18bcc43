"""Compiling ahead (`mbsim warm`): what there is to compile, by running small models."""
