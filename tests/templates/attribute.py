"""`preload_rate` [F/T] of Force_JointFriction: the pin is drawn tighter, preload + preload_rate t.

Template of an attribute that reaches a kernel: what these lines add to three files. Each is what
stands there, then what is put in its place. An attribute that only one law or one force between
markers has is a Parameter in its file, and no more.
"""

LINES = {
    # the element, and its number among those that the kernel gets
    "mbsim/model/forces.py": (
        """    bending_reaction_arm: float = 0.0  # [L]
""",
        """    bending_reaction_arm: float = 0.0  # [L]
    preload_rate: float = 0.0  # [F/T]
""",
        "return radius, self.preload, *arms",
        "return radius, self.preload, *arms, self.preload_rate",
    ),
    # what decks say, with meaning, unit and default for the manual's table
    "mbsim/forces/kinds/joint_friction.py": (
        """    Parameter("preload", about="presses beside the reaction", unit="F"),
""",
        """    Parameter("preload", about="presses beside the reaction", unit="F"),
    Parameter("preload_rate", about="how fast it grows", unit="F/T"),
""",
    ),
    # the formula
    "mbsim/dynamics/forces/joint_friction.py": (
        "RADIUS, PRELOAD, ARM, AXIAL_ARM, TWIST_ARM = range(5)",
        "RADIUS, PRELOAD, ARM, AXIAL_ARM, TWIST_ARM, PRELOAD_RATE = range(6)",
        "    given[NFORCE_IN] = press(scene, f)\n",
        "    given[NFORCE_IN] = press(scene, f) + applied.par[f, PRELOAD_RATE] * t\n",
    ),
}
