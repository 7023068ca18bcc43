"""`pull` [F] of Force_Contact: every contact point draws the surfaces together while they touch.

Template of an attribute of contacts that reaches a kernel: what these lines add to three files.
Each is what stands there, then what is put in its place. An attribute that only one law has is a
Parameter in its file, and no more.
"""

LINES = {
    # the element, and its number among those that kernels get
    "mbsim/model/elements.py": (
        """    contact_points: str = "POINTS"
""",
        """    contact_points: str = "POINTS"
    pull: float = 0.0  # [F]
""",
        "return (math.inf if ignored is None else ignored,)",
        "return math.inf if ignored is None else ignored, self.pull",
    ),
    # what decks say, with meaning, unit and default for the manual's table
    "mbsim/reader/contact.py": (
        """        "master_surface": Spec(""",
        """        "pull": Spec(NOT_NEGATIVE, "draws the surfaces together", "F", "0"),
        "master_surface": Spec(""",
    ),
    # the formula: a force, and what it stores
    "mbsim/dynamics/contact/forces.py": (
        "IGNORE_DEEPER = 0\n",
        "IGNORE_DEEPER, PULL = range(2)\n",
        "    normal, elastic = weight * gain * out[LOAD], weight * gain * out[ELASTIC]\n",
        "    normal, elastic = weight * gain * out[LOAD], weight * gain * out[ELASTIC]\n"
        "    pull = contacts.numbers[c, PULL]\n"
        "    normal, stored = normal - pull, stored - pull * depth\n",
    ),
}
