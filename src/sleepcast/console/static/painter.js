// The thread that draws the view in three dimensions, while the page goes on: it does with `Solids` what painting.js asks for, and
// answers with the picture.

import * as three from "./vendor/three/three.module.min.js";
import { Solids } from "./solids.js";

function begin() {
  try {
    const solids = new Solids(three, new OffscreenCanvas(1, 1));
    self.onmessage = ({ data }) => draw(solids, data);
    self.postMessage({ software: solids.software });
  } catch ({ message }) {
    end({ failure: message });
  }
}

// calls: of `Solids`, each with its arguments. The last one gives the picture, null if the browser has taken the graphics away.
function draw(solids, calls) {
  const begun = performance.now();
  const picture = calls.map(([name, given]) => solids[name](...given)).at(-1);
  if (picture) self.postMessage({ picture, took: performance.now() - begun }, [picture]);
  else end({ lost: true });
}

function end(answer) {
  self.postMessage(answer);
  self.close();
}

begin();
