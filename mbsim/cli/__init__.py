"""The command line: one small module a subcommand, imported when it is called."""
