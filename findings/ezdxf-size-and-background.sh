#!/bin/sh
# How large ezdxf makes the page of an SVG file, by the units of the drawing, and what it puts under the drawing.
#
# Installs a pinned ezdxf in a temporary folder and draws a wall of eight metres with its SVGBackend; nothing of sleepcast
# runs. Needs Python with venv, and the network. One would guess that a drawing says its units so that this wall is as
# long in each, and that no background is drawn if none is asked for. As of ezdxf 1.4.5:
#
#   size         a unit is a millimetre on the page: the wall has 8 mm, 800 mm or 8000 mm by whether it is drawn in metres,
#                centimetres or millimetres; with Settings(scale=1000) that of metres has 8000 mm
#   background   a filled rectangle as large as the page, in a dark colour; with BackgroundPolicy.OFF one as large, in white
#                with an opacity of 0
#
# Whoever reads walls out of such a file gets a building of another size, within a wall that nobody has drawn. Ends with 1
# if that is no longer so.
set -eu
version=1.4.5
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
export HOME="$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check "ezdxf==$version" pillow==13.0.0 2> pip.log || { cat pip.log >&2; exit 1; }
cat > draw.py << 'SCRIPT'
from xml.etree import ElementTree

import ezdxf
from ezdxf.addons.drawing import Frontend, RenderContext, config, layout, svg


def drawn(unit, length, scale=1, background="DEFAULT"):
    document = ezdxf.new(units=getattr(ezdxf.units, unit))
    model = document.modelspace()
    model.add_lwpolyline([(0, 0), (length, 0), (length, length / 2)])
    look = config.Configuration(background_policy=config.BackgroundPolicy[background])
    backend = svg.SVGBackend()
    Frontend(RenderContext(document), backend, config=look).draw_layout(model)
    page = layout.Page(0, 0, layout.Units.mm)
    return ElementTree.fromstring(backend.get_string(page, settings=layout.Settings(scale=scale)))


for unit, length, scale in (("M", 8, 1), ("CM", 800, 1), ("MM", 8000, 1), ("M", 8, 1000)):
    print("size:", length, unit, "scale", scale, "is", drawn(unit, length, scale).get("width"))
for background in ("DEFAULT", "OFF"):
    page = drawn("M", 8, background=background)
    rectangle = page.find("{*}rect")
    whole = [rectangle.get("width"), rectangle.get("height")] == page.get("viewBox").split()[2:]
    print("background:", background, rectangle.get("fill"), rectangle.get("fill-opacity"), "whole page" if whole else "")
SCRIPT
here/bin/python draw.py > found
cat > wanted << 'WANTED'
size: 8 M scale 1 is 8mm
size: 800 CM scale 1 is 800mm
size: 8000 MM scale 1 is 8000mm
size: 8 M scale 1000 is 8000mm
background: DEFAULT #212830 1.0 whole page
background: OFF #ffffff 0.0 whole page
WANTED
echo "ezdxf $version, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
