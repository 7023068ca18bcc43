"""Work against precision: mbsim and other engines on the same scenes."""
