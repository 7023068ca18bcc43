"""A thrown ball slides, then rolls: its way in 2 s over the coefficient of friction."""

import mujoco

XML = """
<mujoco>
  <option timestep="0.001" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom type="plane" size="50 50 1"/>
    <body pos="0 0 0.108"><freejoint/><geom type="sphere" size="0.108" mass="5"/></body>
  </worldbody>
</mujoco>
"""

model = mujoco.MjModel.from_xml_string(XML)
for mu in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3):
    data = mujoco.MjData(model)
    data.qvel[0] = 5.0
    model.geom_friction[:, 0] = mu
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    print(mu, data.qpos[0])
