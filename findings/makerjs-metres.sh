#!/bin/sh
# How large Maker.js draws a rectangle on the page of an SVG file, by the unit of the model.
#
# Installs a pinned makerjs in a temporary folder and exports a rectangle of 8 by 6 units, alone on its page; nothing of
# sleepcast runs. Needs node, npm and the network. One would guess that it fills the page in each unit. As of 0.19.2:
#
#   millimetres, centimetres, inches   it fills the page, which has its size
#   metres, feet                       SVG has no such units, so the page is written in centimetres or inches, a hundred and
#                                      twelve times as many; the rectangle keeps its numbers, and fills a hundredth or a
#                                      twelfth of the width. The option `scale` makes the page larger still
#
# A floor plan that is drawn in metres is so a hundred times too small on a page that has its size. Ends with 1 if that is no
# longer so.
set -eu
version=0.19.2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init -y > npm.log 2>&1
npm install --ignore-scripts --no-audit --no-fund "makerjs@$version" >> npm.log 2>&1 || { cat npm.log >&2; exit 1; }
cat > draw.mjs << 'SCRIPT'
import makerjs from 'makerjs';

for (const unit of ['Millimeter', 'Centimeter', 'Inch', 'Meter', 'Foot']) {
    const model = { units: makerjs.unitType[unit], models: { room: new makerjs.models.Rectangle(8, 6) } };
    const svg = makerjs.exporter.toSVG(model);
    const page = Number(svg.match(/viewBox="0 0 (\S+) /)[1]);
    const drawn = svg.match(/ d="([^"]*)"/)[1].match(/-?[\d.]+/g).map(Number).filter((_, index) => index % 2 === 0);
    const width = Math.max(...drawn) - Math.min(...drawn);
    console.log(`${unit}: page ${svg.match(/width="(\S+)"/)[1]}, of which the rectangle takes 1/${Math.round(page / width)}`);
}
SCRIPT
node draw.mjs > found
cat > wanted << 'WANTED'
Millimeter: page 8mm, of which the rectangle takes 1/1
Centimeter: page 8cm, of which the rectangle takes 1/1
Inch: page 8in, of which the rectangle takes 1/1
Meter: page 800cm, of which the rectangle takes 1/100
Foot: page 96in, of which the rectangle takes 1/12
WANTED
echo "makerjs $version, node $(node --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
