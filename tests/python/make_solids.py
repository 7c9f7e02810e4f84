"""Writes solids as a CAD program exports them, for tests of what is marked on closed bodies.

  make_solids.py FOLDER

NAME.step is the exact part. NAME.fine holds facets of it within 0.005 mm, nine doubles each, made by Open CASCADE's own
mesher. NAME.stl, of some parts, holds coarser facets in single precision. Prints a line for each part: its name, and
`stl` where there is that file, and `flat` where all its faces are planes."""

import array
import math
import os
import struct
import sys

# What Open CASCADE prints is left out.
OUT = os.fdopen(os.dup(1), "w")
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon,
                                BRepBuilderAPI_MakeSolid, BRepBuilderAPI_MakeWire, BRepBuilderAPI_Sewing,
                                BRepBuilderAPI_Transform)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeChamfer, BRepFilletAPI_MakeFillet
from OCP.BRepGProp import BRepGProp
from OCP.BRepLib import BRepLib
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import (BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCone, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakePrism,
                             BRepPrimAPI_MakeRevol, BRepPrimAPI_MakeSphere, BRepPrimAPI_MakeTorus)
from OCP.BRepTools import BRepTools
from OCP.GeomAbs import GeomAbs_Plane
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_VERTEX
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound
from OCP.gp import gp_Ax1, gp_Ax2, gp_Circ, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec

to_edge = getattr(TopoDS, "Edge_s", None) or TopoDS.Edge
to_face = getattr(TopoDS, "Face_s", None) or TopoDS.Face
to_shell = getattr(TopoDS, "Shell_s", None) or TopoDS.Shell
to_vertex = getattr(TopoDS, "Vertex_s", None) or TopoDS.Vertex

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


# --- Shapes. A rectangle is (x0, y0, x1, y1).

def box(rectangle, z0, z1):
    x0, y0, x1, y1 = rectangle
    return BRepPrimAPI_MakeBox(gp_Pnt(x0, y0, z0), gp_Pnt(x1, y1, z1)).Shape()


def axes(at, along):
    return gp_Ax2(gp_Pnt(*at), gp_Dir(*along))


def cylinder(at, along, radius, height):
    return BRepPrimAPI_MakeCylinder(axes(at, along), radius, height).Shape()


def cone(at, along, radius, other, height):
    return BRepPrimAPI_MakeCone(axes(at, along), radius, other, height).Shape()


def sphere(at, radius):
    return BRepPrimAPI_MakeSphere(gp_Pnt(*at), radius).Shape()


def torus(at, radius, small):
    return BRepPrimAPI_MakeTorus(axes(at, Z), radius, small).Shape()


def fuse(first, *others):
    for other in others:
        first = BRepAlgoAPI_Fuse(first, other).Shape()
    return first


def cut(first, *others):
    for other in others:
        first = BRepAlgoAPI_Cut(first, other).Shape()
    return first


def common(a, b):
    return BRepAlgoAPI_Common(a, b).Shape()


def bodies(*shapes):
    together, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(together)
    for shape in shapes:
        builder.Add(together, shape)
    return together


def wire(points):
    polygon = BRepBuilderAPI_MakePolygon()
    for p in points:
        polygon.Add(gp_Pnt(*p))
    polygon.Close()
    return polygon.Wire()


def face(points):
    return BRepBuilderAPI_MakeFace(wire(points), True).Face()


def circle(at, radius):
    edge = BRepBuilderAPI_MakeEdge(gp_Circ(axes(at, Z), radius)).Edge()
    return BRepBuilderAPI_MakeWire(edge).Wire()


def corners(rectangle, z):
    x0, y0, x1, y1 = rectangle
    return [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]


def stack(*levels):
    """The solid between rectangles, each at its height; walls are planes."""
    rings = [corners(rectangle, z) for z, rectangle in levels]
    sewing = BRepBuilderAPI_Sewing(1e-6)
    sewing.Add(face(rings[0]))
    sewing.Add(face(rings[-1]))
    for low, high in zip(rings, rings[1:]):
        for i in range(4):
            j = (i + 1) % 4
            sewing.Add(face([low[i], low[j], high[j], high[i]]))
    sewing.Perform()
    solid = BRepBuilderAPI_MakeSolid(to_shell(sewing.SewedShape())).Solid()
    BRepLib.OrientClosedSolid_s(solid)
    return solid


def loft(ruled, *wires):
    made = BRepOffsetAPI_ThruSections(True, ruled)
    for each in wires:
        made.AddWire(each)
    made.Build()
    return made.Shape()


def prism(points, by):
    return BRepPrimAPI_MakePrism(face(points), gp_Vec(*by)).Shape()


def revolved(points, at):
    """Points are radius and height."""
    profile = face([(at[0] + r, at[1], z) for r, z in points])
    return BRepPrimAPI_MakeRevol(profile, gp_Ax1(gp_Pnt(*at, 0), gp_Dir(*Z)), 2 * math.pi).Shape()


def placed(shape, by=(0, 0, 0), degrees=0, about=Z):
    turn, move = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(*about)), math.radians(degrees))
    move.SetTranslation(gp_Vec(*by))
    return BRepBuilderAPI_Transform(shape, move.Multiplied(turn), True).Shape()


def each(shape, kind):
    found = TopExp_Explorer(shape, kind)
    while found.More():
        yield found.Current()
        found.Next()


def edges_at(shape, z):
    """Edges whose ends both lie at a height, each once."""
    found = []
    for edge in each(shape, TopAbs_EDGE):
        ends = [BRep_Tool.Pnt_s(to_vertex(v)).Z() for v in each(edge, TopAbs_VERTEX)]
        if all(abs(end - z) < 1e-6 for end in ends) and not any(edge.IsSame(other) for other in found):
            found.append(edge)
    return [to_edge(edge) for edge in found]


def rounded(shape, z, radius):
    made = BRepFilletAPI_MakeFillet(shape)
    for edge in edges_at(shape, z):
        made.Add(radius, edge)
    return made.Shape()


def chamfered(shape, z, by):
    made = BRepFilletAPI_MakeChamfer(shape)
    for edge in edges_at(shape, z):
        made.Add(by, edge)
    return made.Shape()


# --- The parts.

FOOT = (0, 0, 40, 30)
PLATE = box(FOOT, 0, 4)


def parting_line():
    return stack((0, (2, 2, 38, 28)), (6, FOOT), (15, (3, 3, 37, 27)))


def half_cylinder(z):
    return common(cylinder((0, 15, z), X, 10, 40), box(FOOT, z, z + 20))


def drafted_pocket():
    return cut(box(FOOT, 0, 12), stack((4, (10, 10, 30, 20)), (12, (8, 8, 32, 22))))


def ramp():
    return prism([(0, 0, 0), (40, 0, 0), (40, 0, 16), (0, 0, 2)], (0, 30, 0))


def stepped_hole(x, y, radius, wide):
    return fuse(cylinder((x, y, -1), Z, radius, 12), cylinder((x, y, 6), Z, wide, 5))


def rings(n, radius, z):
    return [(20 + radius * math.cos(2 * math.pi * i / n), 15 + radius * math.sin(2 * math.pi * i / n), z)
            for i in range(n)]


PARTS = {
    "block_drafted_inwards": lambda: stack((0, FOOT), (10, (4, 4, 36, 26))),
    "block_drafted_outwards": lambda: stack((0, (4, 4, 36, 26)), (10, FOOT)),
    "block_of_three_degrees": lambda: stack((0, FOOT), (20, (1, 1, 39, 29))),
    "block_gentle": lambda: stack((0, FOOT), (3, (12, 9, 28, 21))),
    "parting_line": parting_line,
    "parting_line_turned": lambda: placed(parting_line(), degrees=23.7),
    "half_cylinder": lambda: half_cylinder(0),
    "half_cylinder_on_plate": lambda: fuse(PLATE, half_cylinder(4)),
    "half_sphere": lambda: common(sphere((20, 15, 0), 12), box(FOOT, 0, 20)),
    "half_sphere_on_plate": lambda: fuse(PLATE, common(sphere((20, 15, 4), 12), box(FOOT, 4, 20))),
    "ball_on_stem": lambda: fuse(PLATE, cylinder((20, 15, 2), Z, 4, 8), sphere((20, 15, 14), 8)),
    "core_rounded": lambda: fuse(PLATE, rounded(box((10, 8, 30, 22), 2, 14), 14, 2)),
    "core_chamfered": lambda: fuse(PLATE, chamfered(box((10, 8, 30, 22), 2, 14), 14, 2)),
    "core_drafted_rounded": lambda: rounded(fuse(PLATE, stack((2, (8, 6, 32, 24)), (12, (10, 8, 30, 22)))), 12, 1),
    "core_in_pocket": lambda: fuse(drafted_pocket(), stack((3, (14, 13, 26, 17)), (10, (15, 14, 25, 16)))),
    "pocket_drafted": drafted_pocket,
    "pocket_undercut": lambda: cut(box(FOOT, 0, 12), stack((4, (8, 8, 32, 22)), (12, (10, 10, 30, 20)))),
    "pocket_rounded": lambda: cut(box(FOOT, 0, 12), rounded(box((8, 8, 32, 22), 4, 14), 4, 2)),
    "rib_drafted": lambda: fuse(PLATE, stack((2, (5, 14, 35, 16)), (14, (6, 14.5, 34, 15.5)))),
    "ribs_crossed": lambda: fuse(PLATE, stack((2, (5, 14, 35, 16)), (12, (6, 14.5, 34, 15.5))),
                                 stack((2, (19, 3, 21, 27)), (12, (19.5, 4, 20.5, 26)))),
    "loft_square_to_round": lambda: loft(True, wire(rings(24, 15, 0)), circle((20, 15, 10), 9)),
    "loft_smooth": lambda: loft(False, wire(corners(FOOT, 0)), wire(corners((4, 3, 36, 27), 5)),
                                wire(corners((12, 9, 28, 21), 8))),
    "revolved_cup": lambda: revolved([(0, 0), (12, 0), (15, 12), (13, 12), (11, 3), (0, 3)], (15, 15)),
    "revolved_spool": lambda: revolved([(0, 0), (15, 0), (15, 3), (8, 7), (13, 12), (13, 14), (0, 16)], (15, 15)),
    "wedge": ramp,
    "prism_of_six": lambda: prism(rings(6, 15, 0), (0, 0, 8)),
    "roof": lambda: prism([(0, 0, 0), (0, 30, 0), (0, 15, 15)], (40, 0, 0)),
    "roof_steep": lambda: fuse(PLATE, prism([(0, 10, 2), (0, 20, 2), (0, 15, 17)], (40, 0, 0))),
    "thin_walls": lambda: fuse(PLATE, box((5, 5, 35, 5.2), 2, 12), box((5, 9.95, 35, 10), 2, 12),
                               box((5, 20, 35, 21), 2, 9), box((20, 22, 20.1, 28), 2, 12)),
    "counterbores": lambda: cut(box(FOOT, 0, 10), stepped_hole(10, 10, 2, 4), stepped_hole(26, 15, 3, 8)),
    "countersinks": lambda: cut(box(FOOT, 0, 10), cone((10, 10, 5), Z, 1, 7, 6), cone((27, 15, 1), Z, 6, 9, 9.5)),
    "boss_on_slope": lambda: fuse(ramp(), cylinder((20, 15, 4), Z, 6, 14)),
    "boss_across_slope": lambda: fuse(ramp(), placed(cylinder((0, 0, -3), Z, 6, 10), (20, 15, 9), -20, Y)),
    "shell_open_above": lambda: cut(stack((0, (2, 2, 38, 28)), (12, FOOT)), stack((2, (4, 4, 36, 26)), (12, (2, 2, 38, 28)))),
    "shell_open_below": lambda: cut(stack((0, FOOT), (12, (2, 2, 38, 28))), stack((0, (2, 2, 38, 28)), (10, (4, 4, 36, 26)))),
    "slot_t": lambda: cut(box(FOOT, 0, 14), box((-1, 13, 41, 17), 8, 15), box((-1, 9, 41, 21), 3, 8)),
    "slot_dovetail": lambda: cut(box(FOOT, 0, 14), prism([(-1, 9, 5), (-1, 21, 5), (-1, 18, 14), (-1, 12, 14)], (42, 0, 0))),
    "hole_across": lambda: cut(box(FOOT, 0, 14), cylinder((-1, 15, 7), X, 5, 42)),
    "mushroom": lambda: fuse(cylinder((15, 15, 0), Z, 5, 8), cone((15, 15, 7), Z, 15, 3, 7)),
    "ring": lambda: fuse(PLATE, torus((20, 15, 4), 9, 4)),
    "cylinders_crossed": lambda: fuse(half_cylinder(0), common(cylinder((20, 0, 0), Y, 8, 30), box(FOOT, 0, 20))),
    "stairs": lambda: prism([(0, 0, 0), (40, 0, 0), (40, 0, 12), (30, 0, 12), (30, 0, 8), (18, 0, 8), (18, 0, 5),
                             (7, 0, 5), (7, 0, 2), (0, 0, 2)], (0, 30, 0)),
    "saw_teeth": lambda: prism([(0, 0, 0), (40, 0, 0), (40, 0, 4), (36, 0, 9), (32, 0, 4), (30, 0, 10), (28, 0, 4),
                                (20, 0, 8), (20, 0, 4), (10, 0, 4), (8, 0, 9), (6, 0, 4), (0, 0, 4)], (0, 30, 0)),
    "overhang": lambda: prism([(0, 0, 0), (20, 0, 0), (20, 0, 8), (36, 0, 8), (40, 0, 11), (0, 0, 14)], (0, 30, 0)),
    "bodies_apart": lambda: bodies(stack((0, (0, 0, 15, 30)), (8, (2, 2, 13, 28))), half_cylinder_of_two()),
    "bodies_stacked": lambda: bodies(stack((0, FOOT), (10, (4, 4, 36, 26))),
                                     stack((10, (10, 8, 30, 22)), (16, (11, 9, 29, 21)))),
    "bodies_one_above": lambda: bodies(stack((0, FOOT), (5, (4, 4, 36, 26))),
                                       stack((9, (12, 6, 28, 24)), (12, (11, 5, 29, 25)))),
    "far_from_its_origin": lambda: placed(drafted_pocket(), (1000.5, -2000.25, 300)),
}


def half_cylinder_of_two():
    return common(cylinder((32, 0, 0), Y, 8, 30), box(FOOT, 0, 20))


# Those that are written as STL too: facets with edges on lines of a hatch, with curves, with undercuts, turned and far.
AS_STL = {
    "block_drafted_inwards", "block_drafted_outwards", "block_of_three_degrees", "parting_line", "parting_line_turned",
    "half_cylinder", "half_cylinder_on_plate", "half_sphere", "core_rounded", "core_in_pocket", "pocket_undercut",
    "ribs_crossed", "loft_smooth", "revolved_spool", "thin_walls", "shell_open_below", "slot_t", "mushroom",
    "saw_teeth", "bodies_stacked", "bodies_one_above", "far_from_its_origin",
}


# --- Files.

def facets(shape, chord, angle):
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, chord, False, angle, False)
    for each_face in each(shape, TopAbs_FACE):
        at = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(to_face(each_face), at)
        if mesh is None:
            sys.exit("a face has no facets")
        points = [mesh.Node(i).Transformed(at.Transformation()) for i in range(1, mesh.NbNodes() + 1)]
        for i in range(1, mesh.NbTriangles() + 1):
            a, b, c = mesh.Triangle(i).Get()
            if each_face.Orientation() == TopAbs_REVERSED:
                b, c = c, b
            yield [v for k in (a, b, c) for v in (points[k - 1].X(), points[k - 1].Y(), points[k - 1].Z())]


def write_step(shape, path):
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    if writer.Write(path) != IFSelect_RetDone:
        sys.exit(f"{path} cannot be written")


def write_stl(found, path):
    with open(path, "wb") as out:
        out.write(bytes(80) + struct.pack("<I", len(found)))
        for facet in found:
            out.write(struct.pack("<12fH", 0, 0, 0, *facet, 0))


def is_flat(shape):
    return all(BRepAdaptor_Surface(to_face(f)).GetType() == GeomAbs_Plane for f in each(shape, TopAbs_FACE))


def volume(shape):
    of = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, of)
    return of.Mass()


folder = sys.argv[1]
for name, make in PARTS.items():
    shape = make()
    if volume(shape) < 100:
        sys.exit(f"{name} has {volume(shape)} mm3")
    path = os.path.join(folder, name)
    write_step(shape, path + ".step")
    fine = array.array("d")
    for facet in facets(shape, 0.005, 0.05):
        fine.extend(facet)
    with open(path + ".fine", "wb") as out:
        fine.tofile(out)
    if name in AS_STL:
        write_stl(list(facets(shape, 0.02, 0.2)), path + ".stl")
    print(name, *["stl"] * (name in AS_STL), *["flat"] * is_flat(shape), file=OUT)
OUT.flush()
