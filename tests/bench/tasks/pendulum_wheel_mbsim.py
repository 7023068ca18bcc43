"""A rod on a wheel that rolls on a plane is kept up by a controller of its torque."""

import mbsim

model = mbsim.Model()
wheel = model.body(mass=1, inertia=(0.003, 0.005, 0.003), pos=(0, 0, 0.1))
rod = model.body(mass=0.5, inertia=(0.02, 0.02, 0.001), pos=(0, 0, 0.5))
axle = [
    model.marker(body, pos=(0, 0, 0.1), z_axis=(0, 1, 0)) for body in (rod, wheel, model.ground)
]
model.joint("REVOLUTE", *axle[:2])
model.joint("PLANAR", axle[0], axle[2])
sphere = model.graphic("Sphere", marker=wheel, radius=0.1)
plane = model.graphic("Plane", marker=model.ground)
law = {"stiffness": 1e5, "damping": 200, "dmax": 1e-4, "cff_type": "COULOMB_ON"}
slip = {"stiction_trans_vel": 0.01, "friction_trans_vel": 0.02}
model.contact(sphere, plane, "IMPACT", mu_static=0.8, mu_dynamic=0.7, **slip, **law)
torque = model.variable(label="torque", expr="0")
model.scalar_two_body("ROTATIONAL", axle[1], axle[0], expr=f"VARVAL({torque})")
model.gravity(grav=(0, 0, -9.81))

with mbsim.open(model, end_time=10, print_interval=0.02) as sim:
    position, velocity = f"bodies/{wheel}/position/x", f"bodies/{wheel}/velocity/x"
    sim.inputs["torque"] = 0.4
    sim.step(0.05)
    while not sim.finished:
        lean = 2.5 * (sim.signals[f"bodies/{rod}/position/x"] - sim.signals[position])
        rate = sim.signals[f"bodies/{rod}/angular_velocity/y"]
        control = 0.5 * sim.signals[position] + 1.0 * sim.signals[velocity]
        sim.inputs["torque"] = 20 * lean + 4 * rate + control
        sim.step(0.01)
    print(lean)
