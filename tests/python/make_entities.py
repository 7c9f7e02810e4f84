"""Writes fixtures/entities.dxf: every entity that a DXF drawing may have, at least once. Run it as
`.venv/bin/python tests/python/make_entities.py fixtures/entities.dxf`; the result is committed."""

import sys

import ezdxf
from ezdxf.math import Vec3


def curves(doc, m):
    m.add_line((0, 0, 1), (30, 10, 5), {"layer": "Grain"})
    m.add_arc((50, 5), 8, 350, 20, {"layer": "Grain", "color": 3})
    m.add_arc((50, 5), 12, 90, 450, {"layer": "Rim"})
    m.add_arc((-70, 5), 8, 10, 120, {"extrusion": (0, 0, -1)})
    m.add_arc((10, 5, 30), 8, 200, 120, {"extrusion": (1, 1, 1)})
    m.add_circle((100, 5), 9, {"true_color": 0x102030})
    m.add_circle((5, 100, -7), 6, {"extrusion": (0.3, -0.2, 0.5)})
    m.add_circle((12, 100, 1), 6, {"extrusion": (0.001, 0.002, -1)})
    m.add_ellipse((130, 5, 2), (10, 4, 1), 0.4)
    m.add_ellipse((130, 30), (10, -4), 0.5, 5.5, 1.25)
    m.add_ellipse((130, 50), (3, 9), 0.3, 1, 4, {"extrusion": (0, 0, -1)})
    m.add_ellipse((130, 70), (8, 0, 0), 0.6, 0, 2, {"extrusion": (0, 1, 1)})


def polylines(doc, m):
    zigzag = [(0, 30, 0.5), (10, 30, -0.3), (20, 35, 0), (25, 30, 1), (25, 40, -2.5), (10, 45, 0)]
    m.add_lwpolyline(zigzag, "xyb")
    m.add_lwpolyline(zigzag, "xyb", close=True, dxfattribs={"extrusion": (0, 0, -1), "elevation": 3})
    m.add_lwpolyline(zigzag, "xyb", dxfattribs={"extrusion": (1, -2, 2), "elevation": 4})
    m.add_lwpolyline([(60, 30, 1), (70, 30, 1)], "xyb", close=True)
    m.add_lwpolyline([(80, 30), (90, 30), (90, 40)], dxfattribs={"linetype": "DASHED"})
    m.add_lwpolyline([(80, 30), (80, 30), (80, 42)], dxfattribs={"const_width": 0})
    m.add_polyline2d([(0, 60, 0.2), (10, 60, 0), (10, 70, -0.7)], format="xyb", close=True)
    wide(m)
    fitted = m.add_polyline2d([(20, 60), (25, 64), (30, 66), (40, 60)])
    fitted.dxf.flags |= 4
    for k in (0, 3):
        fitted.vertices[k].dxf.flags = 16
    m.add_polyline3d([(40, 60, 1), (50, 65, 2), (55, 75, -9)])
    m.add_polyline3d([(60, 60, 1), (70, 65, 2), (65, 75, -9)], close=True)


def wide(m):
    m.add_lwpolyline([(100, 60, 1, 2), (110, 60, 2, 2), (120, 70, 2, 0.5), (118, 80, 0, 0)], "xyse")
    ring = [(130, 60), (140, 60), (145, 70), (130, 70)]
    m.add_lwpolyline(ring, close=True, dxfattribs={"const_width": 1.5, "extrusion": (0, 0, -1)})
    m.add_lwpolyline([(150, 60, 1, 1, 0), (160, 60, 1, 1, 1), (160, 68, 1, 3, 0)], "xyseb")
    m.add_lwpolyline([(170, 60, 0, 0), (180, 60, 4, 0), (186, 60, 0, 0)], "xyse")


def splines(doc, m):
    frame = [(0, 80), (10, 95), (20, 70, 5), (30, 90), (40, 80), (50, 88)]
    m.add_open_spline(frame)
    m.add_open_spline(frame, degree=2)
    m.add_open_spline(frame, degree=5)
    rational = m.add_rational_spline(frame, [1, 3, 0.5, 2, 1, 1])
    rational.dxf.color = 5
    m.add_spline().set_closed([Vec3(x, y + 30) for x, y, *_ in frame])
    m.add_spline().set_closed_rational([Vec3(x + 60, y) for x, y, *_ in frame], [1, 2, 3, 1, 2, 3])
    m.add_spline([(0, 120), (10, 130), (14, 128), (30, 118), (31, 140, 4)])
    m.add_spline([(40, 120), (60, 130)])
    tangents = m.add_spline([(40, 130), (50, 140), (70, 128)])
    tangents.dxf.start_tangent = (0, 1)
    tangents.dxf.end_tangent = (-1, -1)


def areas(doc, m):
    m.add_solid([(0, 150), (10, 150), (0, 160), (10, 162)])
    m.add_solid([(20, 150), (30, 150), (25, 160)], {"extrusion": (0, 0, -1)})
    m.add_trace([(40, 150), (50, 152), (40, 160), (50, 163)], {"layer": "Rim"})
    solid = m.add_hatch(color=2)
    solid.paths.add_polyline_path([(60, 150, 0.5), (80, 150, 0), (80, 170, -0.3)], flags=1)
    solid.paths.add_polyline_path([(70, 155), (75, 155), (75, 160)], flags=16)
    solid.paths.add_polyline_path([(71, 156), (74, 156), (74, 158)], flags=0)
    outer = m.add_hatch(color=2, dxfattribs={"hatch_style": 1})
    for path, flags in (([(90, 150), (110, 150), (110, 170)], 1), ([(100, 152), (108, 152), (108, 160)], 16),
                        ([(104, 153), (107, 153), (107, 156)], 0)):
        outer.paths.add_polyline_path(path, flags=flags)
    edges(m.add_hatch(color=4))
    edges(m.add_hatch(color=4, dxfattribs={"extrusion": (0, 0, -1), "elevation": (0, 0, 2)}))
    patterns(m)


def edges(hatch):
    path = hatch.paths.add_edge_path()
    path.add_line((120, 150), (140, 150))
    path.add_arc((140, 160), 10, 270, 90, ccw=True)
    # Runs the other way, as it must for AutoCAD.
    path.add_arc((130, 170), 10, 180, 360, ccw=False)
    path.add_ellipse((120, 160), (0, 10), 0.5, 0, 180, ccw=True)
    hole = hatch.paths.add_edge_path(flags=16)
    hole.add_ellipse((132, 158), (4, 1), 0.5, 0, 360)
    curve = hatch.paths.add_edge_path(flags=16)
    curve.add_spline(control_points=[(140, 155), (146, 155), (146, 161), (140, 161)], degree=3)
    curve.add_line((140, 161), (140, 155))


def patterns(m):
    lines = m.add_hatch()
    lines.set_pattern_fill("LINES", definition=[(45.0, (0.3, 0.1), (-1.1, 1.1), [])])
    lines.paths.add_polyline_path([(150, 150, 0.4), (170, 151, 0), (169, 170, 0)], flags=1)
    lines.paths.add_polyline_path([(160, 155), (165, 155.5), (164, 160)], flags=16)
    dashes = m.add_hatch(dxfattribs={"extrusion": (0, 0, -1)})
    rows = [(20.0, (0.3, 0.1), (0.4, 1.7), [1.5, -0.5, 0.25, -0.5]), (110.0, (0, 0), (-2.0, 0.7), [2, -1, 0, -1])]
    dashes.set_pattern_fill("OWN", definition=rows)
    dashes.paths.add_polyline_path([(-180, 150, 0), (-200, 151, -0.5), (-199, 170, 0)], flags=1)


def blocks(doc, m):
    leaf = doc.blocks.new("Leaf", base_point=(1, 2, 0))
    leaf.add_line((0, 0), (10, 0), {"color": 0})
    leaf.add_circle((5, 5), 3, {"layer": "Grain"})
    leaf.add_arc((5, 5), 4, 20, 200, {"layer": "Off"})
    leaf.add_lwpolyline([(0, 0, 0.5), (5, 0, -1), (9, 3, 0)], "xyb")
    leaf.add_ellipse((4, 4), (3, 1), 0.5, 0.5, 4)
    leaf.add_open_spline([(0, 0), (3, 5), (6, -5), (9, 0)])
    leaf.add_attdef("TAG", (0, 0))
    hatch = leaf.add_hatch()
    hatch.set_pattern_fill("LINES", definition=[(30.0, (0.3, 0.1), (-0.5, 0.9), [1, -0.5])])
    hatch.paths.add_polyline_path([(0, 0, 0.5), (8, 0.5, 0), (7, 6, 0)], flags=1)
    branch = doc.blocks.new("Branch", base_point=(-3, 1, 0))
    branch.add_blockref("Leaf", (10, 0), {"xscale": -1, "rotation": 20, "layer": "Rim", "color": 6})
    branch.add_blockref("Leaf", (0, 10, 2), {"xscale": 2, "yscale": 0.5, "zscale": 3, "rotation": -75})
    branch.add_solid([(0, 0), (2, 0), (0, 2), (2, 3)])
    m.add_blockref("Leaf", (0, 200))
    m.add_blockref("Branch", (40, 200), {"yscale": -1.5, "xscale": 0.7, "rotation": 33, "layer": "Grain"})
    m.add_blockref("Branch", (-90, 200), {"extrusion": (0, 0, -1), "xscale": -1})
    m.add_blockref("Branch", (120, 200, 10), {"extrusion": (1, 2, 5), "rotation": 200, "xscale": 1.3})
    array = {"column_count": 3, "row_count": 2, "column_spacing": 25, "row_spacing": -20, "rotation": 15, "xscale": 2}
    m.add_blockref("Leaf", (160, 220), array)
    m.add_blockref("Leaf", (0, 260), {"column_count": 4, "column_spacing": 0})
    m.add_blockref("Leaf", (30, 260), {"layer": "Off"})
    m.add_blockref("Leaf", (60, 260), {"layer": "Frozen"})
    named = m.add_blockref("Leaf", (90, 260), {"layer": "NoPlot"})
    named.add_attrib("TAG", "text", (90, 262))
    m.add_blockref("Nowhere", (0, 0))


def unread(doc, m):
    m.add_text("text", dxfattribs={"insert": (0, 300)})
    m.add_mtext("text", dxfattribs={"insert": (0, 310)})
    m.add_leader([(0, 0), (5, 5), (9, 5)])
    m.add_linear_dim((5, 330), (0, 320), (10, 320)).render()
    m.add_3dface([(0, 340), (5, 340), (5, 345), (0, 345)])
    m.add_ray((0, 0), (1, 1))
    m.add_xline((0, 0), (1, 1))
    m.add_mline([(0, 350), (10, 350)])
    m.add_point((0, 360))
    m.add_polymesh((2, 2))
    face = m.add_polyface()
    face.append_face([(0, 370), (5, 370), (5, 375)])
    gradient = m.add_hatch()
    gradient.set_gradient()
    gradient.paths.add_polyline_path([(0, 400), (5, 400), (5, 405)])
    m.add_line((0, 0), (1, 1), {"invisible": 1})
    m.add_line((0, 0), (1, 1), {"layer": "Off"})
    m.add_line((0, 0), (1, 1), {"layer": "Frozen"})
    m.add_circle((0, 0), 0)
    m.add_line((3, 3), (3, 3))
    doc.paperspace().add_line((0, 0), (1, 1))


def main(path):
    doc = ezdxf.new("R2004", units=ezdxf.units.MM)
    doc.linetypes.add("DASHED", [1.5, 1.0, -0.5])
    doc.layers.add("Grain", color=1)
    doc.layers.add("Rim", true_color=0xff8000)
    doc.layers.add("Off", color=5).off()
    doc.layers.add("Frozen").freeze()
    doc.layers.add("NoPlot").dxf.plot = 0
    m = doc.modelspace()
    for part in (curves, polylines, splines, areas, blocks, unread):
        part(doc, m)
    doc.saveas(path)


if __name__ == "__main__":
    main(sys.argv[1])
