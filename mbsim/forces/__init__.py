"""Forces between two markers: what a kind of them is, and a file for each."""
