"""Drawings as terrace reads them against ezdxf: shape by shape, in drawing order, curves within 1 um in both directions.

Arguments: files of JSON that the test writes, one for each drawing. ezdxf reads and flattens; which entities are
visible, and how blocks are walked, is decided here anew."""

import collections
import json
import math
import sys

import ezdxf
import numpy as np
from ezdxf import recover
from ezdxf.entities import LWPolyline
from ezdxf.entities.boundary_paths import ArcEdge, EllipseEdge, LineEdge, PolylinePath
from ezdxf.math import BSpline, ConstructionArc, Matrix44, OCS, Vec2, Vec3, fit_points_to_cad_cv
from ezdxf.render.trace import TraceBuilder
from ezdxf.render.hatching import hatch_polygons, pattern_baselines

from job import Fault, demand

LIMIT = 1e-3
FINE = 1e-4


def read(path):
    try:
        return ezdxf.readfile(path)
    except ezdxf.DXFError:
        return recover.readfile(path)[0]


# --- The curves of one entity, in its own coordinates


def bspline(curve, fine):
    """Points of the part of a B-spline that its knots define."""
    p, n, knots = curve.degree, curve.count, list(curve.knots())
    lo, hi = knots[p], knots[n]
    if (lo, hi) == (knots[0], knots[-1]):
        return list(curve.flattening(fine, segments=16))
    # ezdxf flattens beyond the ends of the curve here; its evaluator is used between them.
    steps = max(2000, int(4 * math.sqrt(sum(a.distance(b) for a, b in zip(curve.control_points, curve.control_points[1:])) / fine)))
    return [curve.point(min(t, np.nextafter(hi, lo))) for t in np.linspace(lo, hi, steps)]


def light(points, close, extrusion, height, fine):
    """A polyline with bulges by way of its lines and arcs."""
    line = LWPolyline.new(dxfattribs={"extrusion": extrusion, "elevation": height, "flags": int(close)})
    line.set_points(points, format="xyb")
    out = []
    for part in line.virtual_entities():
        out.append([part.dxf.start, part.dxf.end] if part.dxftype() == "LINE" else list(part.flattening(fine)))
    return out


def curves(e, fine):
    kind = e.dxftype()
    if kind == "LINE":
        return [[e.dxf.start, e.dxf.end]]
    if kind == "POINT":
        return [[e.dxf.location]]
    if kind in ("ARC", "CIRCLE", "ELLIPSE"):
        return [list(e.flattening(fine))]
    if kind == "SPLINE":
        return [bspline(e.construction_tool(), fine)]
    if kind == "LWPOLYLINE":
        return light(e.get_points("xyb"), e.closed, e.dxf.extrusion, e.dxf.elevation, fine)
    if kind == "POLYLINE":
        vertices = [v for v in e.vertices if not v.dxf.flags & 16]
        points = [v.dxf.location for v in vertices]
        if e.is_3d_polyline:
            return [points + points[:1] if e.is_closed else points]
        height = Vec3(e.dxf.get("elevation", (0, 0, 0))).z
        return light([v.format("xyb") for v in vertices], e.is_closed, e.dxf.extrusion, height, fine)
    if kind in ("SOLID", "TRACE"):
        corners = e.wcs_vertices()
        return [corners + corners[:1]]
    assert kind == "HATCH", kind
    return hatch(e, fine)


def edge(e, fine):
    if isinstance(e, LineEdge):
        return [e.start, e.end]
    if isinstance(e, ArcEdge):
        return list(ConstructionArc(e.center, e.radius, e.start_angle, e.end_angle).flattening(fine))
    if isinstance(e, EllipseEdge):
        return Vec2.list(e.construction_tool().flattening(fine))
    if len(e.control_points):
        curve = BSpline(e.control_points, e.degree + 1, e.knot_values, e.weights or None)
        return Vec2.list(bspline(curve, fine))
    return Vec2.list(bspline(fit_points_to_cad_cv(e.fit_points), fine))


def rings(e, fine):
    """Closed polygons of the boundary, in the plane of the hatch."""
    for path in e.paths.rendering_paths(e.dxf.hatch_style):
        if isinstance(path, PolylinePath):
            parts = [Vec2.list(part) for part in light(path.vertices, True, (0, 0, 1), 0, fine)]
        else:
            parts = [edge(part, fine) for part in path.edges]
        ring = parts[0]
        for part in parts[1:]:
            if ring[0].isclose(ring[-1], abs_tol=1e-6):
                yield ring
                ring = part
                continue
            ends = {(i, j): ring[-i].distance(part[-j]) for i in (0, 1) for j in (0, 1)}
            i, j = min(ends, key=ends.get)
            ring = (ring if i else ring[::-1]) + (part[::-1] if j else part)
        yield ring


def hatch(e, fine):
    polygons = list(rings(e, fine))
    if e.dxf.solid_fill:
        flat = [ring + ring[:1] for ring in polygons]
    else:
        flat = []
        for base in pattern_baselines(e):
            for line in hatch_polygons(base, polygons):
                renderer = base.pattern_renderer(line.distance)
                flat += [[a, b] for a, b in renderer.render(line.start, line.end) if a.distance(b) > 1e-9]
    ocs, height = OCS(e.dxf.extrusion), e.dxf.elevation.z
    return [[ocs.to_wcs(Vec3(p.x, p.y, height)) for p in ring] for ring in flat]


class Faces(list):
    """Polygons whose union is an area."""


def area_faults(faces, lines):
    """Points that one area holds and the other does not, farther than 20 um from the contours."""
    points = np.concatenate(lines)
    lo, hi = points.min(axis=0) - 0.5, points.max(axis=0) + 0.5
    x, y = np.random.default_rng(1).uniform(lo, hi, (6000, 2)).T

    def winding(polygon):
        a, b = polygon, np.roll(polygon, -1, axis=0)
        turns = np.zeros(len(x), int)
        for (ax, ay), (bx, by) in zip(a, b):
            side = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            turns += ((ay <= y) & (by > y) & (side > 0)).astype(int) - ((by <= y) & (ay > y) & (side < 0))
        return turns

    boxed = [face for face in faces if np.ptp(face, axis=0).max() > 0]
    theirs = np.zeros(len(x), bool)
    for face in boxed:
        theirs |= winding(face) != 0
    ours = sum(winding(line) for line in lines) != 0
    odd = np.flatnonzero(ours != theirs)
    return [(x[i], y[i]) for i in odd if farthest_any(np.array([[x[i], y[i]]]), lines) > 0.02], int(ours.sum())


def farthest_any(points, lines):
    a = np.concatenate([line[:-1] for line in lines])
    d = np.concatenate([line[1:] - line[:-1] for line in lines])
    v = points[0] - a
    t = np.clip((v * d).sum(axis=1) / (d * d).sum(axis=1), 0, 1)
    return np.sqrt(((v - t[:, None] * d) ** 2).sum(axis=1)).min()


# --- The walk

READ = {"LINE", "POINT", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE", "SOLID", "TRACE", "HATCH"}


class Walk:
    def __init__(self, doc, unit):
        self.doc, self.unit = doc, unit
        self.shapes = []
        self.unread = collections.Counter()
        self.hidden = 0

    def layer(self, name):
        return self.doc.layers.get(name) if self.doc.layers.has_entry(name) else None

    def is_hidden(self, e, layer):
        row = self.layer(layer)
        off = row is not None and row.is_off() and e.dxftype() != "INSERT"
        return e.dxf.get("invisible", 0) or off or (row is not None and row.is_frozen())

    def is_blank(self, e):
        """Whether nothing is seen of a text."""
        kind = e.dxftype()
        if kind in ("TEXT", "ATTRIB"):
            return not e.dxf.get("text", "").strip()
        return kind == "MTEXT" and not e.plain_text().strip()

    def entity(self, e, matrix, around, depth):
        layer = around if e.dxf.layer == "0" else e.dxf.layer
        kind = e.dxftype()
        if self.is_hidden(e, layer):
            self.hidden += 1
        elif kind == "INSERT":
            self.insert(e, matrix, layer, depth)
        elif kind == "ATTDEF" and depth or self.is_blank(e):
            pass
        elif kind not in READ or (kind == "POLYLINE" and (e.is_polygon_mesh or e.is_poly_face_mesh)):
            self.unread[kind] += 1
        elif kind == "HATCH" and e.has_gradient_data and e.gradient.kind:
            self.unread[kind] += 1
        else:
            scale = self.unit * max(matrix.transform_direction(v).magnitude for v in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
            parts = [np.array([(p.x, p.y) for p in matrix.transform_vertices(Vec3.list(part))]) * self.unit
                     for part in curves(e, FINE / scale) if len(part) > 1 or kind == "POINT"]
            parts = [part for part in parts if kind == "POINT" or np.ptp(part, axis=0).max() > 2e-6]
            if kind == "LWPOLYLINE" and e.has_width:
                self.wide(e, matrix)
            elif parts:
                self.shapes.append((kind, e.dxf.handle, parts))

    def wide(self, e, matrix):
        """A polyline with a width: its thin parts, and the faces of the others."""
        ocs, height = OCS(e.dxf.extrusion), e.dxf.elevation
        def flat(points):
            points = matrix.transform_vertices(ocs.to_wcs(Vec3(p.x, p.y, height)) for p in points)
            return np.array([(p.x, p.y) for p in points]) * self.unit
        rows = e.get_points()
        ends = list(zip(rows, rows[1:] + rows[:1] if e.closed else rows[1:]))
        thin = [flat([Vec2(a[:2]), Vec2(b[:2])]) for a, b in ends if not (a[2] or a[3] or a[4] or e.dxf.const_width)]
        if thin:
            self.shapes.append(("LWPOLYLINE", e.dxf.handle, thin))
        # ezdxf mitres where the width jumps, as at the base of an arrow head; these parts are drawn one by one.
        whole = e.dxf.const_width or all(a[3] == b[2] for a, b in ends[:-1])
        faces = []
        for pair in [None] if whole else ends:
            part = e if whole else LWPolyline.new(dxfattribs={"elevation": height})
            if pair:
                part.set_points(pair)
            if whole or any(pair[0][2:4]):
                faces += TraceBuilder.from_polyline(part, segments=400).faces()
        faces = [flat(face) for face in faces if max(a.distance(b) for a in face for b in face) > 1e-9]
        self.shapes.append(("LWPOLYLINE", e.dxf.handle, Faces(faces)))

    def insert(self, e, matrix, layer, depth):
        block = self.doc.blocks.get(e.dxf.name)
        for copy in e.multi_insert() if e.mcount > 1 else [e]:
            for part in block or []:
                self.entity(part, copy.matrix44() * matrix, layer, depth + 1)
        for attrib in e.attribs:
            if self.is_hidden(attrib, attrib.dxf.layer) or attrib.is_invisible:
                self.hidden += 1
            elif not self.is_blank(attrib):
                self.unread["ATTRIB"] += 1


# --- Comparison


def samples(lines):
    out = []
    for line in lines:
        a, b = line[:-1], line[1:]
        out += [a + (b - a) * t for t in ((0, 0.21, 0.5, 0.83) if len(line) > 20 else np.linspace(0, 1, 40))]
        out.append(line[-1:])
    return np.concatenate(out)


def farthest(points, lines):
    """Largest distance of the points from the lines."""
    a = np.concatenate([line[:-1] for line in lines])
    d = np.concatenate([line[1:] - line[:-1] for line in lines])
    keep = (d * d).sum(axis=1) > 0
    a, d = a[keep], d[keep]
    lo, hi = np.minimum(a, a + d) - LIMIT, np.maximum(a, a + d) + LIMIT
    worst = 0.0
    # Neighbours lie near each other: only segments near their box can be within the limit of one of them.
    for k in range(0, len(points), 64):
        p = points[k:k + 64]
        near = ((lo <= p.max(axis=0)) & (hi >= p.min(axis=0))).all(axis=1)
        if not near.any():
            return math.inf
        v = p[:, None, :] - a[near][None]
        e = d[near]
        t = np.clip((v * e).sum(axis=2) / (e * e).sum(axis=1), 0, 1)
        v -= t[..., None] * e
        worst = max(worst, np.sqrt((v * v).sum(axis=2).min(axis=1)).max())
    return worst


def check(path):
    with open(path, encoding="utf-8") as stream:
        ours = json.load(stream)
    doc = read(ours["file"])
    walk = Walk(doc, ours["unit_mm"])
    for e in doc.modelspace():
        walk.entity(e, Matrix44(), "0", 0)
    name = ours["file"].rsplit("/", 1)[-1]
    demand(dict(walk.unread) == ours["unread"], f"{name}: not read: {dict(walk.unread)} here, {ours['unread']} there")
    demand(walk.hidden == ours["hidden"], f"{name}: hidden: {walk.hidden} here, {ours['hidden']} there")
    shapes = ours["shapes"]
    for (kind, handle, _), shape in zip(walk.shapes, shapes):
        wanted = f"{kind} {handle}" if " at line " not in shape["name"] else kind
        demand(shape["name"] == wanted or shape["name"].startswith(wanted + " at "), f"{name}: {shape['name']} for {wanted}")
    demand(len(walk.shapes) == len(shapes), f"{name}: {len(walk.shapes)} shapes here, {len(shapes)} there")
    worst, points = 0.0, 0
    for (_, _, parts), shape in zip(walk.shapes, shapes):
        lines = [np.array(line) for line in shape["lines"]]
        points += sum(map(len, lines))
        if len(parts[0]) == 1:
            off = np.abs(lines[0] - parts[0]).max()
            demand(len(lines) == 1 and lines[0].shape == (1, 2) and off <= LIMIT, f"{name}: {shape['name']}: {off} mm off")
            continue
        if isinstance(parts, Faces):
            odd, inside = area_faults(parts, lines)
            demand(not odd and inside > 100, f"{name}: {shape['name']}: areas differ at {odd[:3]}, {inside} points inside")
            continue
        ways = farthest(samples(lines), parts), farthest(samples(parts), lines)
        demand(max(ways) <= LIMIT, f"{name}: {shape['name']}: {ways[0]:.6f} mm off ezdxf's curve, {ways[1]:.6f} mm from it")
        worst = max(worst, *ways)
    return f"{name}: {len(shapes)} shapes, {points} points, {worst * 1e3:.3f} um, {sum(walk.unread.values())} not read"


def main(paths):
    faults = []
    for path in paths:
        try:
            print("ok", check(path))
        except Fault as fault:
            faults.append(str(fault))
    for fault in faults:
        print(fault)
    sys.exit(bool(faults))


if __name__ == "__main__":
    main(sys.argv[1:])
