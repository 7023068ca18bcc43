"""125 balls fall into a heap on a plane, with friction."""

import numpy as np

import mbsim

model = mbsim.Model()
places = [(0.105 * i, 0.105 * j, 0.06 + 0.105 * k) for k in range(5) for i, j in np.ndindex(5, 5)]
noise = np.random.default_rng(1).uniform(-0.002, 0.002, (125, 3))
balls = [
    model.graphic("Sphere", marker=model.body(density=1000, pos=place), radius=0.05)
    for place in places + noise
]
plane = model.graphic("Plane", marker=model.ground)
law = {"stiffness": 1e6, "damping": 100, "dmax": 1e-4, "cff_type": "STICTION"}
for other in (balls, plane):
    model.contact(balls, other, "IMPACT", mu_static=0.4, mu_dynamic=0.4, **law)
model.gravity(grav=(0, 0, -9.81))
model.transient(integrator_type="MOREAU", h_max=1e-3)
results = mbsim.simulate(model, end_time=1, print_interval=0.05)
print(np.mean([results[name][-1] for name in results.find("bodies/*/position/z")]))
