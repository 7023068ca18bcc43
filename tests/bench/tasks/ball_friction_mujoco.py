"""A bowling ball slides, then rolls, under friction of one's own: mu = 0.1 + 0.1 exp(-v)."""

import math

import mujoco

XML = """
<mujoco>
  <option timestep="0.001" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom type="plane" size="50 50 1" condim="3"/>
    <body pos="0 0 0.108"><freejoint/>
      <geom type="sphere" size="0.108" mass="5" condim="3"/>
    </body>
  </worldbody>
</mujoco>
"""

model = mujoco.MjModel.from_xml_string(XML)
data = mujoco.MjData(model)
data.qvel[0] = 5.0
while data.time < 4.0:
    slip = math.hypot(data.qvel[0] - 0.108 * data.qvel[4], data.qvel[1] + 0.108 * data.qvel[3])
    model.geom_friction[:, 0] = 0.1 + 0.1 * math.exp(-slip)
    mujoco.mj_step(model, data)
print(data.qvel[0])
