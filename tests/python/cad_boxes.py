"""Writes STEP and IGES files of boxes, some of which are hidden, for tests of the converter.

  cad_boxes.py FOLDER

bodies.step     three bodies, the first and the last hidden
all.step        two bodies, both hidden
layer.step      two bodies, the second on a hidden layer
part.step       an assembly of two assemblies of a part and a cover, the cover hidden
instance.step   the same: the second instance of the part in the inner assembly hidden, so twice
higher.step     the same: that instance hidden in one of the two inner assemblies alone
large.step      a body of 5 m
plate.igs       a body of 40 x 30 x 5 mm
"""

import os
import pathlib
import sys

# What Open CASCADE prints is of no use.
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.collections import Sequence_TDF_Attribute, Sequence_TDF_Label
from OCP.IGESControl import IGESControl_Writer
from OCP.gp import gp_Pnt, gp_Trsf, gp_Vec
from OCP.Quantity import Quantity_Color, Quantity_NOC_RED
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFApp import XCAFApp_Application
from OCP.XCAFDoc import XCAFDoc_ColorSurf, XCAFDoc_DocumentTool, XCAFDoc_GraphNode, XCAFDoc_ShapeTool

FOLDER = pathlib.Path(sys.argv[1])


class Document:
    def __init__(self):
        self.document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
        XCAFApp_Application.GetApplication_s().NewDocument(TCollection_ExtendedString("MDTV-XCAF"), self.document)
        main = self.document.Main()
        self.shapes = XCAFDoc_DocumentTool.ShapeTool_s(main)
        self.colours = XCAFDoc_DocumentTool.ColorTool_s(main)
        self.layers = XCAFDoc_DocumentTool.LayerTool_s(main)

    def body(self, name, lo, size):
        return self.named(self.shapes.AddShape(BRepPrimAPI_MakeBox(gp_Pnt(*lo), *size).Shape(), False), name)

    def named(self, label, name):
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))
        return label

    def assembly(self, name, *components):
        """An assembly of labels at places, and the labels of these components."""
        label = self.named(self.shapes.NewShape(), name)
        places = []
        for part, at in components:
            shift = gp_Trsf()
            shift.SetTranslation(gp_Vec(*at))
            places.append(self.shapes.AddComponent(label, part, TopLoc_Location(shift)))
        return label, places

    def hide(self, label):
        self.colours.SetVisibility(label, False)

    def write(self, name):
        writer = STEPCAFControl_Writer()
        writer.SetSHUOMode(True)
        writer.Transfer(self.document, STEPControl_AsIs)
        writer.Write(str(FOLDER / name))


def bodies(name, count, *hidden):
    made = Document()
    for i in range(count):
        body = made.body(f"body {i}", (20 * i, 0, 0), (10, 10, 5 * (i + 1)))
        if i in hidden:
            made.hide(body)
    made.write(name)


def layer():
    made = Document()
    for i in range(2):
        made.layers.SetLayer(made.body(f"body {i}", (20 * i, 0, 0), (10, 10, 5)), TCollection_ExtendedString(f"layer {i}"))
    made.layers.SetVisibility(made.layers.FindLayer(TCollection_ExtendedString("layer 1")), False)
    made.write("layer.step")


def assembly(name, hide):
    made = Document()
    part, cover = made.body("part", (0, 0, 0), (10, 10, 5)), made.body("cover", (0, 0, 5), (10, 10, 1))
    made.colours.SetColor(part, Quantity_Color(Quantity_NOC_RED), XCAFDoc_ColorSurf)
    inner, components = made.assembly("inner", (part, (0, 0, 0)), (part, (20, 0, 10)), (cover, (0, 0, 0)))
    _, upper = made.assembly("outer", (inner, (0, 0, 0)), (inner, (0, 30, 20)))
    made.shapes.UpdateAssemblies()
    hide(made, cover, components, upper)
    made.write(name)


def hide_in_one(made, _, components, upper):
    path = Sequence_TDF_Label()
    for label in (upper[1], components[1]):
        path.Append(label)
    made.shapes.SetSHUO(path, XCAFDoc_GraphNode())
    found = Sequence_TDF_Attribute()
    XCAFDoc_ShapeTool.GetAllComponentSHUO_s(upper[1], found)
    made.hide(found.Value(1).Label())


bodies("bodies.step", 3, 0, 2)
bodies("all.step", 2, 0, 1)
layer()
assembly("part.step", lambda made, cover, *_: made.hide(cover))
assembly("instance.step", lambda made, _, components, upper: made.hide(components[1]))
assembly("higher.step", hide_in_one)
large = Document()
large.body("large", (-2500, 0, 0), (5000, 10, 10))
large.write("large.step")
plate = IGESControl_Writer()
plate.AddShape(BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), 40, 30, 5).Shape())
plate.ComputeModel()
plate.Write(str(FOLDER / "plate.igs"))
