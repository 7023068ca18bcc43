"""From what a deck names to a file that has been read: scripts, libraries, Octave."""
