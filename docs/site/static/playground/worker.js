// Evaluates expressions aside from the page, by docs/site/playground.py in Pyodide. Messages: {number, text, readings} in,
// {number, found} out, or {number, failure} if there is no Python.

import { loadPyodide } from "../vendor/pyodide/pyodide.mjs";

const ARCHIVE = "/playground.zip";

async function prepare() {
  const packages = new URL("../vendor/pyodide/", import.meta.url).href;
  const [pyodide, archive] = await Promise.all([
    loadPyodide({ indexURL: packages }),
    fetch(new URL("sleepcast.zip", import.meta.url)),
  ]);
  if (!archive.ok) throw new Error(`sleepcast.zip: ${archive.status} ${archive.statusText}`);
  pyodide.FS.writeFile(ARCHIVE, new Uint8Array(await archive.arrayBuffer()));
  pyodide.pyimport("sys").path.insert(0, ARCHIVE);
  const { answer } = pyodide.pyimport("playground");
  return (text, readings) => JSON.parse(answer(text, pyodide.toPy(readings)));
}

const prepared = prepare();

onmessage = async ({ data: { number, text, readings } }) => {
  try {
    const answer = await prepared;
    postMessage({ number, found: answer(text, readings) });
  } catch (error) {
    postMessage({ number, failure: String(error.message ?? error) });
  }
};
