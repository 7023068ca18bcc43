"""Forces between markers, in joints, and by the user's own equations."""
