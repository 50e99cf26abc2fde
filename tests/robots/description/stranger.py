"""A stranger's robot with traps: a first joint that slides, a mimic finger, a wrist without end, no inertia, names
with spaces, a mesh that is missing, another chain."""

from __future__ import annotations

from pathlib import Path

import trimesh

URDF = """<?xml version="1.0"?>
<!-- Made by hand. -->
<robot name="stranger's robot">
  <material name="orange"><color rgba="0.9 0.5 0.1 1"/></material>
  <link name="rail"><visual><geometry><box size="2 0.1 0.1"/></geometry></visual></link>
  <link name="carriage">
    <visual>
      <origin xyz="0 0 0.05"/>
      <geometry>
        <mesh filename="package://strange things/my meshes/block one.stl" scale="0.001 0.001 0.001"/>
      </geometry>
      <material name="orange"/>
    </visual>
    <inertial><mass value="4"/><inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial>
  </link>
  <link name="upper"><visual><geometry><mesh filename="my meshes/gone.dae"/></geometry></visual></link>
  <link name="fore">
    <visual><origin xyz="0.2 0 0"/><geometry><cylinder radius="0.03" length="0.4"/></geometry></visual>
    <inertial><mass value="1"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.02"/></inertial>
  </link>
  <link name="wrist"/>
  <link name="palm"><visual><geometry><sphere radius="0.04"/></geometry></visual></link>
  <link name="finger"/> <link name="other finger"/>
  <link name="lamp post"/> <link name="lamp"/>
  <joint name="slide" type="prismatic">
    <parent link="rail"/><child link="carriage"/><axis xyz="2 0 0"/>
    <limit lower="-0.8" upper="0.8" effort="200" velocity="0.6"/>
  </joint>
  <joint name="shoulder" type="revolute">
    <parent link="carriage"/><child link="upper"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/>
    <limit lower="-2.5" upper="2.5" effort="60" velocity="2"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit effort="40" velocity="0"/>
  </joint>
  <joint name="roll" type="continuous">
    <parent link="fore"/><child link="wrist"/><origin xyz="0.4 0 0"/><limit effort="5" velocity="3"/>
  </joint>
  <joint name="tool" type="fixed"><parent link="wrist"/><child link="palm"/><origin xyz="0.1 0 0"/></joint>
  <joint name="grip" type="prismatic">
    <parent link="palm"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.03" effort="5" velocity="0.1"/>
  </joint>
  <joint name="grip too" type="prismatic">
    <parent link="palm"/><child link="other finger"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.03" effort="5" velocity="0.1"/><mimic joint="grip" multiplier="1"/>
  </joint>
  <joint name="pan" type="revolute">
    <parent link="rail"/><child link="lamp post"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="tilt" type="revolute">
    <parent link="lamp post"/><child link="lamp"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>
"""


def write(folder: Path) -> Path:
    """Write the robot and its mesh below a folder; returns the URDF."""
    home = folder / "strange things"
    (home / "my meshes").mkdir(parents=True)
    (home / "robots").mkdir()
    trimesh.creation.box(extents=(200, 160, 100)).export(home / "my meshes" / "block one.stl")
    path = home / "robots" / "my robot.urdf"
    path.write_text(URDF)
    return path
