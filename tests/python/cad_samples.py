"""Prints points of the exact surfaces of a STEP or IGES file, for tests of its facets.

  cad_samples.py FILE N

N by N points of each face, spread over its parameters, those outside of its borders left out: a line each with x, y, z
in mm and the z of the unit normal there."""

import os
import sys

OUT = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepClass import BRepClass_FaceClassifier
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.IGESControl import IGESControl_Reader
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_FACE, TopAbs_IN
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

path, count = sys.argv[1], int(sys.argv[2])
reader = IGESControl_Reader() if path.lower().endswith((".igs", ".iges")) else STEPControl_Reader()
reader.ReadFile(path)
reader.TransferRoots()
faces = TopExp_Explorer(reader.OneShape(), TopAbs_FACE)
while faces.More():
    face = TopoDS.Face(faces.Current())
    surface = BRepAdaptor_Surface(face)
    u0, u1 = surface.FirstUParameter(), surface.LastUParameter()
    v0, v1 = surface.FirstVParameter(), surface.LastVParameter()
    for i in range(count):
        for j in range(count):
            # No point of this grid lies on a knot of the fixtures.
            u, v = (a + (k + 0.37) / count * (b - a) for k, a, b in ((i, u0, u1), (j, v0, v1)))
            if BRepClass_FaceClassifier(face, gp_Pnt2d(u, v), 1e-7).State() != TopAbs_IN:
                continue
            at, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
            surface.D1(u, v, at, along_u, along_v)
            normal = along_u.Crossed(along_v)
            if normal.Magnitude() > 0:
                print(at.X(), at.Y(), at.Z(), abs(normal.Z()) / normal.Magnitude(), file=OUT)
    faces.Next()
OUT.flush()
