"""MARKER_VELOCITY_IN_J: how fast I moves as seen from J, v_I - v_J - w_J x (p_I - p_J), and turns.

Template of a type of requests of how markers move: what these lines add to two files. Each is what
stands there, then what is put in its place.
"""

LINES = {
    # name, columns F1..F8, what F1..F4 and F5..F8 measure
    "mbsim/model/request_types.py": (
        '    "MARKER_FORCE": RequestType(',
        """    "MARKER_VELOCITY_IN_J": RequestType(
        ("mag", "vx", "vy", "vz", "wmag", "wx", "wy", "wz"),
        ("velocity", "angular_velocity"),
    ),
    "MARKER_FORCE": RequestType(""",
    ),
    # F2..F4 and F6..F8, global axes
    "mbsim/results/requests.py": (
        '    "MARKER_ACCELERATION": lambda',
        """    "MARKER_VELOCITY_IN_J": lambda i, j: (
        i.v - j.v - np.cross(j.w, i.p - j.p),
        i.w - j.w,
    ),
    "MARKER_ACCELERATION": lambda""",
    ),
}
