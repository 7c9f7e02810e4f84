"""Reads a STEP or IGES file with Open CASCADE and writes its faces as triangles to the standard output.

  convert.py FILE step|iges CHORD_MM ANGLE_RAD SECONDS MEGABYTES

Answers with lines of JSON. The first says which version reads: {"terrace": 1, "occt": "8.0.1.1"}, or {"absent": why}
where the bindings are not there. The second is {"error": kind, "text": ...} or the header of the mesh; after it come
the vertices (three doubles each, mm) and the triangles (three 32-bit indices each), lowest byte first.

Triangles face as their face does. Each face is first meshed coarsely inside and within CHORD_MM along its edges, then
triangles are divided on the exact surface until edges and centres lie within SHARE of CHORD_MM of it: Open CASCADE's own mesher
needs time with the square of the number of triangles, and exceeds the chord tolerance inside of faces."""

import array
import gc
import io
import json
import os
import sys

# One file is read, and no cycles are left behind: the collector would only look at all of the bindings, again and again
# while they are loaded, which is a fifth of that time.
gc.disable()

# What Open CASCADE prints is not part of the answer.
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
        # At the system's own limit of processor time the process is killed; a second before it is told.
        own = hard - 1 if what == resource.RLIMIT_CPU and hard > 1 else hard
        resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, own), hard))


try:
    limit(int(sys.argv[5]), int(sys.argv[6]))
    import OCP
    from OCP.BRep import BRep_Builder, BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.Bnd import Bnd_Box
    from OCP.GeomAbs import GeomAbs_Plane
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.IGESControl import IGESControl_Reader
    from OCP.IMeshTools import IMeshTools_Parameters
    from OCP.Interface import Interface_Static
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.STEPConstruct import STEPConstruct, STEPConstruct_ExternRefs
    from OCP.STEPControl import STEPControl_Reader
    from OCP.StepRepr import StepRepr_RepresentationItem
    from OCP.StepShape import StepShape_ShapeRepresentation
    from OCP.StepVisual import (StepVisual_OverRidingStyledItem, StepVisual_PresentationLayerAssignment,
                                StepVisual_StyledItem)
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_Label
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopAbs import (TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SHAPE, TopAbs_SHELL,
                            TopAbs_SOLID, TopAbs_VERTEX)
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Iterator
    from OCP.XCAFDoc import XCAFDoc_ColorTool, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool
except (ImportError, MemoryError) as e:
    if isinstance(e, MemoryError) or "failed to map" in str(e) or "allocate memory" in str(e):
        say(terrace=1)
        fail("memory")
    say(absent=f"{type(e).__name__}: {e}")
    sys.exit(0)
say(terrace=1, occt=getattr(OCP, "__version__", "unknown"))


def static(of, name):
    """A static method, whose name has "_s" behind it in some versions of the bindings."""
    return getattr(of, name + "_s", None) or getattr(of, name)


to_edge, to_vertex, to_face = (static(TopoDS, name) for name in ("Edge", "Vertex", "Face"))


def parts(shape, kind, outside=TopAbs_SHAPE):
    found = TopExp_Explorer(shape, kind, outside)
    while found.More():
        yield found.Current()
        found.Next()


def iges_units(head):
    """The unit of an IGES file: its name, or that of its flag. That one of the two is there was checked before."""
    by_flag = {1: "inch", 2: "mm", 4: "ft", 5: "mi", 6: "m", 7: "km", 8: "mil", 9: "um", 10: "cm", 11: "uin"}
    name = head.UnitName()
    return [name.ToCString().lower()] if name else [by_flag[head.UnitFlag()]] if head.UnitFlag() in by_flag else []


def has_faces(shape):
    return shape is not None and not shape.IsNull() and next(parts(shape, TopAbs_FACE), None) is not None


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


def complaints(reader, kind):
    """What the reader could not make of entities, and what it remarks."""
    work = reader.WS()
    failed, remarks = [], []
    for found in (work.ModelCheckList(), work.TransferReader().TransientProcess().CheckList(True)):
        found.Start()
        while found.More():
            check, entity = found.Value(), found.Value().Entity()
            name = entity.DynamicType().Name().split("_", 1)[-1] + ": " if entity is not None else ""
            # The head of an IGES file (units, dates, authors) is checked before, and holds no faces.
            if kind == "step" or entity is not None:
                failed += [name + check.CFail(i).strip() for i in range(1, check.NbFails() + 1)]
                remarks += [name + check.CWarning(i).strip() for i in range(1, check.NbWarnings() + 1)]
            found.Next()
    # What is hidden is told by itself.
    passed_over = ("NOT AVAILABLE FOR CHECK", "Invisibility: ")
    failed = [text for text in failed if not any(words in text for words in passed_over)]
    return failed, remarks


def entities(model, names):
    """The entities of these types."""
    found = {name: [] for name in names}
    for i in range(1, model.NbEntities() + 1):
        entity = model.Value(i)
        list_of = found.get(entity.DynamicType().Name())
        if list_of is not None:
            list_of.append(entity)
    return [found[name] for name in names]


def refuse_unit_of_unit(units):
    """Ends where a length unit is so many of a unit that is no SI unit itself: Open CASCADE reads it as if it were."""
    for unit in units:
        factor = unit.ConversionFactor()
        base = factor.UnitComponent().NamedUnit() if factor is not None else None
        if base is not None and not base.DynamicType().Name().startswith("StepBasic_SiUnit"):
            fail("unit-of-unit", unit.Name().ToCString())


def sequence(fill, *first):
    """The items of a sequence that a function fills."""
    try:
        from OCP.collections import Sequence_TDF_Label as Labels
    except ImportError:
        from OCP.TDF import TDF_LabelSequence as Labels
    items = Labels()
    fill(*first, items)
    return [items.Value(i) for i in range(1, items.Size() + 1)]


def hidden_items(invisible):
    """The items of shapes that a file hides; how many more it hides in some of their instances alone, and how many
    entities of kinds that Open CASCADE does not know."""
    todo = [of.InvisibleItems().Value(i).Value() for of in invisible for i in range(1, of.NbInvisibleItems() + 1)]
    items, instances, seen, unknown = [], 0, {}, sum(item is None for item in todo)
    while todo:
        item = todo.pop()
        if item is None or id(item) in seen:
            continue
        # As long as it is kept, the bindings give the same object for it.
        seen[id(item)] = item
        if isinstance(item, StepVisual_OverRidingStyledItem):
            instances += 1
        elif isinstance(item, StepVisual_StyledItem):
            todo.append(item.ItemAP242().Value() or item.Item())
        elif isinstance(item, StepVisual_PresentationLayerAssignment):
            todo += [item.AssignedItemsValue(i).Value() for i in range(1, item.NbAssignedItems() + 1)]
        elif isinstance(item, StepShape_ShapeRepresentation):
            todo += [item.ItemsValue(i) for i in range(1, item.NbItems() + 1)]
        elif isinstance(item, StepRepr_RepresentationItem):
            items.append(item)
    return items, instances, unknown


def named(label):
    """The name of a label."""
    name = TDataStd_Name()
    has_name = label.IsAttribute(static(TDataStd_Name, "GetID")()) and label.FindAttribute(name.ID(), name)
    return name.Get().ToExtString().strip() if has_name and name.Get().Length() > 0 else ""


class Visible:
    """What a STEP file shows: its shapes without those that it hides.

    Bodies and faces are hidden by their entity, in all instances of their part (`hidden`); instances are known to the
    reader of documents (`tools`), and so are whole parts."""

    def __init__(self, hidden, tools, has_instances):
        self.hidden, self.tools, self.has_instances = {}, tools, has_instances
        for name, shape in hidden:
            self.hidden.setdefault(hash(shape), []).append((shape, name))
        # How deep shapes are looked into: kinds of shapes are in the order of their nesting.
        self.deepest = max([shape.ShapeType().value for _, shape in hidden], default=-1)
        # Texts of what is left out, and how many of them are instances.
        self.left_out, self.instances = [], 0

    def leave_out(self, name, shape):
        box = Bnd_Box()
        static(BRepBndLib, "Add")(shape, box)
        # 0 and not -0.
        corners = [", ".join(f"{round(v, 3) + 0.0:.3f}" for v in (p.X(), p.Y(), p.Z()))
                   for p in (box.CornerMin(), box.CornerMax())]
        quoted = f'"{name}" ' if name else ""
        self.left_out.append(f"{quoted}from ({corners[0]}) to ({corners[1]}) mm")

    def without(self, shape, place, name):
        """A shape without what is hidden in it; None if it is hidden itself. `place` is where it goes."""
        for hidden, own_name in self.hidden.get(hash(shape), []):
            if hidden.IsSame(shape):
                self.leave_out(own_name or name, shape.Moved(place))
                return None
        if shape.ShapeType().value >= self.deepest:
            return shape
        inner, kept, is_whole = place.Multiplied(shape.Location()), shape.EmptyCopied(), True
        children = TopoDS_Iterator(shape, False, False)
        while children.More():
            part = self.without(children.Value(), inner, name)
            is_whole = is_whole and part is not None and part.IsSame(children.Value())
            if part is not None:
                BRep_Builder().Add(kept, part)
            children.Next()
        return shape if is_whole else kept

    def is_hidden(self, label, target, shape):
        is_visible = static(XCAFDoc_ColorTool, "IsVisible")
        if is_visible(target) and is_visible(label):
            return self.has_instances and not self.tools[1].IsInstanceVisible(shape)
        return True

    def label(self, label, place):
        """What of a label is visible, in its place."""
        target = label
        if static(XCAFDoc_ShapeTool, "IsReference")(label):
            target = TDF_Label()
            static(XCAFDoc_ShapeTool, "GetReferredShape")(label, target)
            place = place.Multiplied(static(XCAFDoc_ShapeTool, "GetLocation")(label))
        shape = static(XCAFDoc_ShapeTool, "GetShape")(target)
        if self.is_hidden(label, target, shape.Moved(place)):
            self.instances += 1
            self.leave_out(named(target) or named(label), shape.Moved(place))
            return []
        if static(XCAFDoc_ShapeTool, "IsAssembly")(target):
            components = sequence(static(XCAFDoc_ShapeTool, "GetComponents"), target)
            return [part for component in components for part in self.label(component, place)]
        shape = self.without(shape, place, named(target))
        return [] if shape is None else [shape.Moved(place)]

    def shape(self, whole):
        """All that is visible."""
        if self.tools is None:
            return self.without(whole, TopLoc_Location(), "")
        all_of_it = TopoDS_Compound()
        BRep_Builder().MakeCompound(all_of_it)
        for label in sequence(self.tools[0].GetFreeShapes):
            for part in self.label(label, TopLoc_Location()):
                BRep_Builder().Add(all_of_it, part)
        return all_of_it


def transfer(reader, with_document):
    """The shape of a file, a document about it where asked for, and whether all roots were read."""
    if not with_document:
        roots = reader.NbRootsForTransfer()
        read = reader.TransferRoots()
        return reader.OneShape() if read > 0 else None, None, roots - read
    document = TDocStd_Document(TCollection_ExtendedString("terrace"))
    of_document = STEPCAFControl_Reader(reader.WS(), False)
    of_document.SetColorMode(True)
    of_document.SetNameMode(True)
    of_document.SetSHUOMode(True)
    of_document.Transfer(document)
    inner = of_document.ChangeReader()
    shape = inner.OneShape() if inner.NbShapes() > 0 else None
    return shape, document, max(0, inner.NbRootsForTransfer() - inner.NbShapes())


def tools_of(document, whole):
    """The tools for shapes and colours of a document; None if it does not hold all faces of the file."""
    if document is None:
        return None
    shapes, colours = (static(XCAFDoc_DocumentTool, name)(document.Main()) for name in ("ShapeTool", "ColorTool"))
    count = lambda shape: sum(1 for _ in parts(shape, TopAbs_FACE))
    get = static(XCAFDoc_ShapeTool, "GetShape")
    is_whole = sum(count(get(label)) for label in sequence(shapes.GetFreeShapes)) == count(whole)
    return (shapes, colours) if is_whole else None


def read_step(reader):
    """The shape that a STEP file shows, what it hides, how many entities of unknown kinds it hides, and how many roots were
    not read."""
    model, work = reader.WS().Model(), reader.WS()
    invisible, units = entities(model, ["StepVisual_Invisibility", "StepBasic_ConversionBasedUnitAndLengthUnit"])
    refuse_unit_of_unit(units)
    items, instances, unknown = hidden_items(invisible)
    # The reader of documents opens other files that this one refers to.
    others = STEPConstruct_ExternRefs(work)
    others.LoadExternRefs()
    whole, document, lost = transfer(reader, invisible and others.NbExternRefs() == 0)
    if whole is None or not invisible:
        return whole, [], 0, lost
    find, process = static(STEPConstruct, "FindShape"), work.TransferReader().TransientProcess()
    hidden = []
    for item in items:
        name, shape = item.Name(), find(process, item)
        if has_faces(shape):
            hidden.append((name.ToCString().strip() if name is not None else "", shape))
    visible = Visible(hidden, tools_of(document, whole), instances > 0)
    shape = visible.shape(whole)
    if instances > 0 and visible.instances == 0:
        fail("hidden-unclear", f"{instances} instances")
    if not has_faces(shape) and visible.left_out:
        fail("hidden", "; ".join(visible.left_out[:3]))
    return shape, visible.left_out, unknown, lost


def load(reader, path, kind):
    """Reads a file into the reader. A UTF-8 mark before a STEP file is more than Open CASCADE takes."""
    with open(path, "rb") as file:
        if kind == "step" and file.read(3) == b"\xef\xbb\xbf":
            return reader.ReadStream("part.step", io.BytesIO(file.read()))
    return reader.ReadFile(path)


def read(path, kind):
    """The shape of the file in mm, its length units, what it hides, and what could not be read."""
    reader = STEPControl_Reader() if kind == "step" else IGESControl_Reader()
    if kind == "iges":
        # Not what the CAD program hides.
        reader.SetReadVisible(True)
    Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")
    if load(reader, path, kind) != IFSelect_RetDone:
        fail("unreadable", "; ".join(sum(complaints(reader, kind), [])[:MESSAGES]))
    hidden, unknown = [], 0
    if kind == "step":
        units = length_units(reader)
        shape, hidden, unknown, lost = read_step(reader)
    else:
        units = iges_units(reader.IGESModel().GlobalSection())
        shape, _, lost = transfer(reader, False)
    failed, remarks = complaints(reader, kind)
    if lost > 0:
        failed.insert(0, f"{lost} of {reader.NbRootsForTransfer()} shapes were not read")
    return shape, units, (hidden, unknown), failed, remarks


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
    shape, units, (hidden, unknown), failed, remarks = read(path, kind)
    if not has_faces(shape):
        fail("empty", "; ".join(failed[:MESSAGES]))
    if not units:
        fail("unit")
    refuse_size(shape)
    vertices, triangles, count, without, worst = mesh_of(shape, chord, angle)
    say(unit=" and ".join(units), faces=count, bodies=bodies(shape), free_edges=free_edges(shape),
        without_triangles=without, worst_mm=worst, hidden_count=len(hidden), hidden=hidden[:MESSAGES],
        hidden_unknown=unknown, failed_count=len(failed), failed=failed[:MESSAGES],
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
