"""Two fingers close on a box by a force, and lift it by a motion."""

import mujoco

XML = """
<mujoco>
  <option timestep="0.001" cone="elliptic" impratio="10"/>
  <default><geom friction="0.6" condim="4"/></default>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body name="box" pos="0 0 0.05"><freejoint/>
      <geom type="box" size="0.05 0.05 0.05" density="500"/>
    </body>
    <body name="hand" pos="0 0 0.3">
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <joint name="lift" type="slide" axis="0 0 1"/>
      <body pos="-0.07 0 -0.25"><joint name="left" type="slide" axis="-1 0 0" damping="10"/>
        <geom type="box" size="0.01 0.03 0.03" mass="0.2"/>
      </body>
      <body pos="0.07 0 -0.25"><joint name="right" type="slide" axis="1 0 0" damping="10"/>
        <geom type="box" size="0.01 0.03 0.03" mass="0.2"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position joint="lift" kp="20000" kv="400"/>
    <motor joint="left"/>
    <motor joint="right"/>
  </actuator>
</mujoco>
"""

model = mujoco.MjModel.from_xml_string(XML)
data = mujoco.MjData(model)
while data.time < 2.0:
    u = min(max(data.time - 0.5, 0.0), 1.0)
    data.ctrl[:] = 0.2 * u * u * (3 - 2 * u), -20, -20
    mujoco.mj_step(model, data)
print(data.body("box").xpos[2])
