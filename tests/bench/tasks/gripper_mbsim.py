"""Two fingers close on a box by a force, and lift it by a motion."""

import mbsim

model = mbsim.Model()
box = model.body(density=500, pos=(0, 0, 0.05))
block = model.graphic("BoxDefinedFromCenter", marker=box, length=(0.1, 0.1, 0.1))
plane = model.graphic("Plane", marker=model.ground)
hand = model.body(mass=1, inertia=(1, 1, 1), pos=(0, 0, 0.3))
lift = model.joint("TRANSLATIONAL", hand, model.ground, pos=(0, 0, 0.3), z_axis=(0, 0, 1))
model.motion_joint(lift, "DISPLACEMENT", motion_type="T", expr="STEP(TIME, 0.5, 0, 1.5, 0.2)")
pads = []
for side in (-1, 1):
    finger = model.body(mass=0.2, inertia=(0.01, 0.01, 0.01), pos=(0.07 * side, 0, 0.05))
    ends = [
        model.marker(body, pos=(x, 0, 0.05), z_axis=(side, 0, 0))
        for body, x in ((finger, 0.07 * side), (hand, 0))
    ]
    model.joint("TRANSLATIONAL", *ends)
    model.scalar_two_body("TRANSLATIONAL", *ends, expr="-20-10*VR({},{})".format(*ends))
    pads.append(model.graphic("BoxDefinedFromCenter", marker=finger, length=(0.02, 0.06, 0.06)))
law = {"stiffness": 1e6, "damping": 200, "dmax": 1e-4, "cff_type": "STICTION"}
model.contact(block, [*pads, plane], "IMPACT", mu_static=0.6, mu_dynamic=0.5, **law)
model.gravity(grav=(0, 0, -9.81))
results = mbsim.simulate(model, end_time=2, print_interval=0.01)
print(results[f"bodies/{box}/position/z"][-1])
