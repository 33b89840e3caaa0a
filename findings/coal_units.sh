#!/bin/sh
# Coal 3.0.3: MeshLoader takes the numbers of a Collada file for metres, whatever the file's <unit meter="..."/> says.
# A mesh in centimetres (meter="0.01"), as modelling programs export, is a hundred times too large, and with it every
# distance to the robot's collision bodies; the loader's scale is the only way to say it. The up axis of the file is
# left out, too, which is what descriptions of robots count on: many of their files say Y_UP and have z upwards.
#
# Fails as soon as the unit or the up axis changes what is loaded.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "coal==3.0.3" "numpy==2.3.5"
cd "$folder"
"$folder/env/bin/python" - <<'PYTHON'
import coal
import numpy as np

TEXT = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="its own" meter="{unit}"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="shape"><mesh>
<source id="corners"><float_array id="numbers" count="12">0 0 0  10 0 0  0 20 0  0 0 30</float_array>
<technique_common><accessor source="#numbers" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="points"><input semantic="POSITION" source="#corners"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#points" offset="0"/>
<p>0 2 1  0 1 3  0 3 2  1 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="scene"><node><instance_geometry url="#shape"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>"""

for unit, up in (("1", "Z_UP"), ("0.01", "Z_UP"), ("0.0254", "Y_UP")):
    with open("shape.dae", "w", encoding="utf-8") as stream:
        stream.write(TEXT.format(unit=unit, up=up))
    size = np.ptp(coal.MeshLoader().load("shape.dae", np.ones(3)).vertices(), axis=0)
    print(f"10 x 20 x 30 units of {unit:>6} m, {up}: loaded as {' x '.join(f'{x:g}' for x in size)}")
    assert size.tolist() == [10.0, 20.0, 30.0], (unit, up, size)
PYTHON
