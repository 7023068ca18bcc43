"""125 balls fall into a heap on a plane, with friction."""

import mujoco
import numpy as np

spec = mujoco.MjSpec()
spec.option.timestep = 0.001
ground = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 1])
ground.friction[0] = 0.4
places = [(0.105 * i, 0.105 * j, 0.06 + 0.105 * k) for k in range(5) for i, j in np.ndindex(5, 5)]
noise = np.random.default_rng(1).uniform(-0.002, 0.002, (125, 3))
for place in places + noise:
    body = spec.worldbody.add_body(pos=place)
    body.add_freejoint()
    geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0], density=1000)
    geom.friction[0] = 0.4
model = spec.compile()
data = mujoco.MjData(model)
while data.time < 1.0:
    mujoco.mj_step(model, data)
print(data.xpos[1:, 2].mean())
