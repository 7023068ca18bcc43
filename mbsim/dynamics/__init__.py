"""The equations of motion: from (t, y) to y', in stages."""
