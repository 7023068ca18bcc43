"""A thrown ball slides, then rolls: its way in 2 s over the coefficient of friction."""

import mbsim

model = mbsim.Model()
ball = model.body(mass=5, inertia=[0.4 * 5 * 0.108**2] * 3, pos=(0, 0, 0.108), v_ic=(5, 0, 0))
sphere = model.graphic("Sphere", marker=ball, radius=0.108)
plane = model.graphic("Plane", marker=model.ground)
law = {"stiffness": 1e7, "damping": 1e3, "dmax": 1e-4, "cff_type": "TANH"}
model.contact(sphere, plane, "IMPACT", mu_dynamic=0.1, friction_trans_vel=1e-3, **law)
model.gravity(grav=(0, 0, -9.81))
for mu in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3):
    changed = {"Force_Contact[1].mu_dynamic": mu}
    results = mbsim.simulate(model, overrides=changed, end_time=2, print_interval=0.01)
    print(mu, results[f"bodies/{ball}/position/x"][-1])
