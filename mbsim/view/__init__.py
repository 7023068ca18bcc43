"""Results to look at: a 3D view and a report as one HTML file each, pictures, glTF."""
