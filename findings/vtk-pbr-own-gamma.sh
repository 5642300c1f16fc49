#!/usr/bin/env bash
# VTK 9.7.2: materials by SetInterpolationToPBR are in the picture as (radiance)^(1/2.2), those by other interpolations as the
# radiance itself, side by side in one picture. Colours are not decoded: a matte plane of albedo 0.5 under a light of intensity 1 is
# 0.5 by Phong's model and 0.43 by PBR; where the light falls in at 60 degrees the first is half as bright as before, the second
# 0.73 of it. What PBR draws is, to 1.5 / 255, the model of appendix B of glTF 2.0 with roughness 1, no metal, and the light's
# intensity as its irradiance, which has the 1 / pi that Phong's model has not. Seen on 2026-11-29. (It needs EGL:
# `apt install libegl1 libgl1-mesa-dri`.)
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check vtk==9.7.2 numpy==2.4.6
cat > planes.py <<'END_OF_PYTHON'
import math

import vtk
from vtk.util.numpy_support import vtk_to_numpy


def shown(albedo, degrees):
    """Values, from 0 to 1, of a plane by Phong's model, on the left, and one by PBR, on the right of one picture."""
    renderer, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
    for left, pbr in (-1.0, False), (0.0, True):
        plane = vtk.vtkPlaneSource()
        plane.SetOrigin(left, -0.5, 0)
        plane.SetPoint1(left + 1, -0.5, 0)
        plane.SetPoint2(left, 0.5, 0)
        mapper, actor = vtk.vtkPolyDataMapper(), vtk.vtkActor()
        mapper.SetInputConnection(plane.GetOutputPort())
        actor.SetMapper(mapper)
        material = actor.GetProperty()
        material.SetColor(albedo, albedo, albedo)
        if pbr:
            material.SetInterpolationToPBR()
            material.SetRoughness(1)
            material.SetMetallic(0)
        else:
            material.SetAmbient(0)
            material.SetDiffuse(1)
            material.SetSpecular(0)
        renderer.AddActor(actor)
    light, angle = vtk.vtkLight(), math.radians(degrees)
    light.SetLightTypeToSceneLight()
    light.SetPosition(0, math.sin(angle), math.cos(angle))
    light.SetFocalPoint(0, 0, 0)
    light.SetIntensity(1)
    renderer.SetAutomaticLightCreation(False)
    renderer.AddLight(light)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(0, 0, 10)
    camera.SetFocalPoint(0, 0, 0)
    camera.SetParallelProjection(True)
    camera.SetParallelScale(0.4)
    window.SetOffScreenRendering(True)
    window.SetSize(64, 32)
    window.AddRenderer(renderer)
    window.Render()
    grabbed = vtk.vtkWindowToImageFilter()
    grabbed.SetInput(window)
    grabbed.ReadFrontBufferOff()
    grabbed.Update()
    pixels = vtk_to_numpy(grabbed.GetOutput().GetPointData().GetScalars()).reshape(32, 64, -1)
    return pixels[16, 16, 0] / 255, pixels[16, 48, 0] / 255


def gltf(albedo, cosine):
    """Appendix B of glTF 2.0 straight from above: roughness 1, no metal, irradiance 1 on a plane across the light."""
    half = math.sqrt((1 + cosine) / 2)
    fresnel = 0.04 + 0.96 * (1 - half) ** 5
    return ((1 - fresnel) * albedo + fresnel * 0.5 / (cosine + 1)) / math.pi * cosine


for albedo in 0.1, 0.2, 0.5, 0.9:
    for degrees in 0, 60:
        cosine = math.cos(math.radians(degrees))
        phong, pbr = shown(albedo, degrees)
        expected = gltf(albedo, cosine) ** (1 / 2.2)
        print(f"albedo {albedo}, light at {degrees}: Phong {phong:.3f} (albedo cos: {albedo * cosine:.3f}), PBR {pbr:.3f} ({expected:.3f})")
        assert abs(phong - albedo * cosine) < 1.5 / 255
        assert abs(pbr - expected) < 1.5 / 255
END_OF_PYTHON
venv/bin/python planes.py 2> log || { cat log; exit 1; }
