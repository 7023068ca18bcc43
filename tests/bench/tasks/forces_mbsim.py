"""Look at contact forces: a cube is pushed over a plane; forces over time, and a picture."""

import mbsim

model = mbsim.Model()
cube = model.body(density=1000, pos=(0, 0, 0.05), v_ic=(1, 0, 0))
box = model.graphic("BoxDefinedFromCenter", marker=cube, length=(0.1, 0.1, 0.1))
plane = model.graphic("Plane", marker=model.ground)
law = {"stiffness": 1e6, "damping": 1e3, "dmax": 1e-4, "cff_type": "STICTION"}
push = model.contact(box, plane, "IMPACT", mu_static=0.4, mu_dynamic=0.3, **law)
model.gravity(grav=(0, 0, -9.81))
results = mbsim.simulate(model, end_time=0.5, print_interval=0.002)
force = results[f"contacts/{push}/force"]
print(force[50])
results.plot(f"contacts/{push}/force").figure.savefig("forces.png")
