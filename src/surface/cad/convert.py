"""Reads a STEP or IGES file with Open CASCADE and writes its faces as triangles to the standard output.

  convert.py FILE step|iges CHORD_MM ANGLE_RAD SECONDS MEGABYTES

Answers with lines of JSON. The first says which version reads: {"terrace": 1, "occt": "8.0.1.1"}, or {"absent": why}
where the bindings are not there. The second is {"error": kind, "text": ...} or the header of the mesh; after it come
the vertices (three doubles each, mm) and the triangles (three 32-bit indices each), lowest byte first.

Triangles face as their face does. Each face is first meshed coarsely inside and within CHORD_MM along its edges, then
triangles are divided on the exact surface until edges and centres lie within SHARE of CHORD_MM of it: Open CASCADE's own mesher
needs time with the square of the number of triangles, and exceeds the chord tolerance inside of faces."""

import array
import json
import os
import sys

# What Open CASCADE prints is no part of the answer.
ANSWER = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)

# Facets are divided until they lie within this part of the chord tolerance at the places measured: between those the
# distance is a little larger.
SHARE = 0.9
# How much coarser the inside of faces is meshed at first.
COARSER = 16
# Rounds of division; each halves the edges that it divides.
ROUNDS = 40
# Parts lie within this distance of their origin, mm.
REACH = 4000.0
# Messages of the reader that are handed on.
MESSAGES = 20


def say(**values):
    ANSWER.write(json.dumps(values).encode() + b"\n")
    ANSWER.flush()


def fail(kind, text=""):
    say(error=kind, text=text)
    sys.exit(0)


def limit(seconds, megabytes):
    """Bounds memory, and time for the case that nobody waits any longer. Windows has no such limits."""
    try:
        import resource
    except ImportError:
        return
    for what, most in ((resource.RLIMIT_AS, megabytes << 20), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(what)[1]
        resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


try:
    limit(int(sys.argv[5]), int(sys.argv[6]))
    import OCP
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.GeomAbs import GeomAbs_Plane
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.IGESControl import IGESControl_Reader
    from OCP.IMeshTools import IMeshTools_Parameters
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import (TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SHAPE, TopAbs_SHELL, TopAbs_SOLID,
                            TopAbs_VERTEX)
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS
except (ImportError, MemoryError) as e:
    if isinstance(e, MemoryError) or "failed to map" in str(e) or "allocate memory" in str(e):
        say(terrace=1)
        fail("memory")
    say(absent=f"{type(e).__name__}: {e}")
    sys.exit(0)
say(terrace=1, occt=getattr(OCP, "__version__", "unknown"))

to_edge = getattr(TopoDS, "Edge_s", None) or TopoDS.Edge
to_vertex = getattr(TopoDS, "Vertex_s", None) or TopoDS.Vertex
to_face = getattr(TopoDS, "Face_s", None) or TopoDS.Face


def parts(shape, kind, outside=TopAbs_SHAPE):
    found = TopExp_Explorer(shape, kind, outside)
    while found.More():
        yield found.Current()
        found.Next()


def length_units(reader):
    """Names of the length units that the file states for its shapes."""
    try:
        from OCP.collections import Sequence_TCollection_AsciiString as Names
    except ImportError:
        from OCP.TColStd import TColStd_SequenceOfAsciiString as Names
    lengths = Names()
    reader.FileUnits(lengths, Names(), Names())
    names = [lengths.Value(i).ToCString().lower() for i in range(1, lengths.Size() + 1)]
    return sorted(set(names))


def complaints(reader):
    """What the reader could not make of entities, and what it remarks."""
    work = reader.WS()
    failed, remarks = [], []
    for found in (work.ModelCheckList(), work.TransferReader().TransientProcess().CheckList(True)):
        found.Start()
        while found.More():
            check, entity = found.Value(), found.Value().Entity()
            name = entity.DynamicType().Name().split("_", 1)[-1] + ": " if entity is not None else ""
            failed += [name + check.CFail(i).strip() for i in range(1, check.NbFails() + 1)]
            remarks += [name + check.CWarning(i).strip() for i in range(1, check.NbWarnings() + 1)]
            found.Next()
    failed = [text for text in failed if "NOT AVAILABLE FOR CHECK" not in text]
    return failed, remarks


def read(path, kind):
    """The shape of the file in mm, its length units, and what could not be read."""
    reader = STEPControl_Reader() if kind == "step" else IGESControl_Reader()
    if kind == "iges":
        # Not what the CAD program hides.
        reader.SetReadVisible(True)
    Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")
    if reader.ReadFile(path) != IFSelect_RetDone:
        fail("unreadable", "; ".join(sum(complaints(reader), [])[:MESSAGES]))
    if kind == "step":
        units = length_units(reader)
    else:
        unit = reader.IGESModel().GlobalSection().UnitName()
        units = [unit.ToCString().lower()] if unit else []
    roots = reader.NbRootsForTransfer()
    read = reader.TransferRoots()
    failed, remarks = complaints(reader)
    if read < roots:
        failed.insert(0, f"{roots - read} of {roots} shapes were not read")
    return reader.OneShape() if read > 0 else None, units, failed, remarks


def free_edges(shape):
    """How many edges belong to one face alone."""
    seen = {}
    for face in parts(shape, TopAbs_FACE):
        for edge in parts(face, TopAbs_EDGE):
            if not BRep_Tool.Degenerated_s(to_edge(edge)):
                alike = seen.setdefault(hash(edge), [])
                for other in alike:
                    if other[0].IsSame(edge):
                        other[1] += 1
                        break
                else:
                    alike.append([edge, 1])
    return sum(count == 1 for alike in seen.values() for _, count in alike)


def bodies(shape):
    """Solids, shells of no solid, faces of no shell."""
    kinds = ((TopAbs_SOLID, TopAbs_SHAPE), (TopAbs_SHELL, TopAbs_SOLID), (TopAbs_FACE, TopAbs_SHELL))
    return sum(sum(1 for _ in parts(shape, kind, outside)) for kind, outside in kinds)


def key(a, b):
    return (a, b) if a < b else (b, a)


def edges(triangle):
    a, b, c = triangle
    return key(a, b), key(b, c), key(c, a)


class Patch:
    """The triangles of a face: nodes with their parameters, divided until they lie within `chord` of the surface.

    Edges that one triangle alone has are the border: neighbouring faces share them, so they are never divided. Of the
    edges of a triangle that is divided the longest is divided too (Rivara 1984): angles stay bounded, and it ends."""

    def __init__(self, face, mesh, location, chord):
        self.chord2 = chord * chord
        surface = BRepAdaptor_Surface(face)
        self.value = surface.Value
        self.curved = surface.GetType() != GeomAbs_Plane and mesh.HasUVNodes()
        nodes = range(1, mesh.NbNodes() + 1)
        here = location.Transformation()
        self.points = [mesh.Node(i).Transformed(here).Coord() for i in nodes]
        self.uv = [mesh.UVNode(i).Coord() for i in nodes] if self.curved else []
        self.triangles = [tuple(k - 1 for k in mesh.Triangle(i).Get()) for i in range(1, mesh.NbTriangles() + 1)]
        self.mirrored = here.IsNegative()
        # The largest square of a distance that stays.
        self.worst2 = 0.0
        # By edge its length squared (-1 for the border), and whether it lies off the surface.
        self.known = {}

    def distance2(self, a, b):
        """The square of the largest distance of the surface from an edge, at 0.3 and 0.7 of it, where an arc has 0.84
        of its height, and an edge through an inflection is seen too."""
        (ua, va), (ub, vb) = self.uv[a], self.uv[b]
        (x0, y0, z0), (x1, y1, z1) = self.points[a], self.points[b]
        dx, dy, dz = x1 - x0, y1 - y0, z1 - z0
        length2 = dx * dx + dy * dy + dz * dz
        most = 0.0
        for s in (0.3, 0.7):
            x, y, z = self.value(ua + s * (ub - ua), va + s * (vb - va)).Coord()
            x, y, z = x - x0, y - y0, z - z0
            t = (x * dx + y * dy + z * dz) / length2 if length2 > 0 else 0.0
            x, y, z = x - t * dx, y - t * dy, z - t * dz
            most = max(most, x * x + y * y + z * z)
        return most / (0.84 * 0.84)

    def measured(self, edge):
        a, b = edge
        length2 = sum((p - q) ** 2 for p, q in zip(self.points[a], self.points[b]))
        off = False
        # A shorter edge cannot lie off a smooth surface.
        if length2 > 16 * self.chord2:
            distance2 = self.distance2(a, b)
            off = distance2 > self.chord2
            if not off:
                self.worst2 = max(self.worst2, distance2)
        self.known[edge] = found = (length2, off)
        return found

    def about(self, edge):
        return self.known.get(edge) or self.measured(edge)

    def centre2(self, triangle):
        """The square of the distance of the surface from the plane of a triangle, at its centre."""
        a, b, c = triangle
        (ua, va), (ub, vb), (uc, vc) = self.uv[a], self.uv[b], self.uv[c]
        x, y, z = self.value((ua + ub + uc) / 3, (va + vb + vc) / 3).Coord()
        (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = self.points[a], self.points[b], self.points[c]
        ax, ay, az, bx, by, bz = x1 - x0, y1 - y0, z1 - z0, x2 - x0, y2 - y0, z2 - z0
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        n2 = nx * nx + ny * ny + nz * nz
        d = nx * (x - x0) + ny * (y - y0) + nz * (z - z0)
        return d * d / n2 if n2 > 0 else 0.0

    def to_divide(self, active):
        """The edges of these triangles that are to be divided because the surface is too far off."""
        wanted = {}
        for triangle in active:
            about = [(self.about(edge), edge) for edge in edges(triangle)]
            off = [edge for (_, off), edge in about if off]
            if off:
                wanted.update((edge, None) for edge in off)
                continue
            centre2 = self.centre2(triangle)
            (length2, _), longest = max(about)
            if centre2 > self.chord2 and length2 > 16 * self.chord2:
                wanted[longest] = None
            elif length2 > 16 * self.chord2:
                self.worst2 = max(self.worst2, centre2)
        return wanted

    def with_longest(self, wanted, triangles):
        """Adds the longest edge of each triangle that has an edge to divide, until there is none to add."""
        grown = True
        while grown:
            grown = False
            for triangle in triangles:
                three = edges(triangle)
                if any(edge in wanted for edge in three):
                    (length2, _), longest = max((self.about(edge), edge) for edge in three)
                    if length2 >= 0 and longest not in wanted:
                        wanted[longest] = None
                        grown = True

    def divided(self, triangles, middles):
        """Triangles that stay, and the new ones: bisected across the longest divided edge, halves across theirs."""
        same, new = [], []
        for triangle in triangles:
            three = edges(triangle)
            cut = [middles.get(edge) for edge in three]
            if cut == [None, None, None]:
                same.append(triangle)
                continue
            _, i = max((self.known[edge][0], i) for i, edge in enumerate(three) if cut[i] is not None)
            a, b, c = triangle[i:] + triangle[:i]
            p, q, r = cut[i:] + cut[:i]
            new += [(p, b, c)] if q is None else [(p, b, q), (p, q, c)]
            new += [(a, p, c)] if r is None else [(a, p, r), (p, c, r)]
        return same, new

    def refine(self):
        if not self.curved:
            return
        count = {}
        for triangle in self.triangles:
            for edge in edges(triangle):
                count[edge] = count.get(edge, 0) + 1
        for edge, faces in count.items():
            if faces == 1:
                self.worst2 = max(self.worst2, self.distance2(*edge))
                self.known[edge] = (-1.0, False)
        same, active = [], self.triangles
        for _ in range(ROUNDS):
            middles = self.to_divide(active)
            if not middles:
                break
            self.with_longest(middles, same + active)
            for a, b in middles:
                (ua, va), (ub, vb) = self.uv[a], self.uv[b]
                middles[a, b] = len(self.points)
                u, v = (ua + ub) / 2, (va + vb) / 2
                self.uv.append((u, v))
                self.points.append(self.value(u, v).Coord())
            same, active = self.divided(same + active, middles)
        else:
            raise RuntimeError("a face cannot be divided into triangles within the chord tolerance")
        self.triangles = same + active


def refuse_size(shape):
    """Ends where corners of faces lie out of reach: fine facets of such a part would take minutes."""
    corners = [BRep_Tool.Pnt_s(to_vertex(vertex)).Coord() for vertex in parts(shape, TopAbs_VERTEX)]
    if all(abs(v) <= REACH for corner in corners for v in corner):
        return
    size = max(max(axis) - min(axis) for axis in zip(*corners))
    BRepMesh_IncrementalMesh(shape, max(size, REACH) / 1000, False, 0.5)
    points = []
    for face in parts(shape, TopAbs_FACE):
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(to_face(face), location)
        here = location.Transformation()
        nodes = range(1, mesh.NbNodes() + 1 if mesh is not None else 1)
        points += [mesh.Node(i).Transformed(here).Coord() for i in nodes]
    low, high = ([f(axis) for axis in zip(*(points or corners))] for f in (min, max))
    shown = [", ".join(f"{v:.3f}" for v in corner) for corner in (low, high)]
    fail("size", f"from ({shown[0]}) to ({shown[1]}) mm")


def mesh_of(shape, chord, angle):
    """Vertices, triangles, how many faces there are and have none, and the largest distance measured."""
    asked = IMeshTools_Parameters()
    asked.Deflection, asked.DeflectionInterior, asked.Angle = chord, COARSER * chord, angle
    BRepMesh_IncrementalMesh(shape, asked)
    vertices, triangles = array.array("d"), array.array("I")
    count, without, worst2 = 0, 0, 0.0
    for shape_of_face in parts(shape, TopAbs_FACE):
        face, location = to_face(shape_of_face), TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, location)
        count += 1
        if mesh is None or mesh.NbTriangles() == 0:
            without += 1
            continue
        patch = Patch(face, mesh, location, SHARE * chord)
        patch.refine()
        worst2 = max(worst2, patch.worst2)
        first = len(vertices) // 3
        for point in patch.points:
            vertices.extend(point)
        # The mesh of a face faces along its surface's normal.
        turned = (face.Orientation() == TopAbs_REVERSED) != patch.mirrored
        for a, b, c in patch.triangles:
            triangles.extend((first + a, first + c, first + b) if turned else (first + a, first + b, first + c))
    return vertices, triangles, count, without, worst2 ** 0.5


def main(path, kind, chord, angle):
    shape, units, failed, remarks = read(path, kind)
    if shape is None or next(parts(shape, TopAbs_FACE), None) is None:
        fail("empty", "; ".join(failed[:MESSAGES]))
    if not units:
        fail("unit")
    refuse_size(shape)
    vertices, triangles, count, without, worst = mesh_of(shape, chord, angle)
    say(unit=" and ".join(units), faces=count, bodies=bodies(shape), free_edges=free_edges(shape),
        without_triangles=without, worst_mm=worst, failed_count=len(failed), failed=failed[:MESSAGES],
        remarks_count=len(remarks), remarks=remarks[:MESSAGES], vertices=len(vertices) // 3,
        triangles=len(triangles) // 3)
    if sys.byteorder == "big":
        vertices.byteswap()
        triangles.byteswap()
    ANSWER.write(vertices.tobytes())
    ANSWER.write(triangles.tobytes())
    ANSWER.flush()


try:
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4]))
except MemoryError:
    fail("memory")
except Exception as e:
    # Failures of Open CASCADE are exceptions of its own.
    fail("memory" if "OutOfMemory" in type(e).__name__ else "failed", f"{type(e).__name__}: {e}")
