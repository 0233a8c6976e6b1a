// Runs the Python code that comes on stdin in Pyodide, with a folder of modules first on its path:
// node pyodide.mjs PYODIDE FOLDER
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [pyodide, folder] = process.argv.slice(2);
const { loadPyodide } = await import(pathToFileURL(`${pyodide}/pyodide.mjs`));
const python = await loadPyodide();
python.mountNodeFS("/modules", folder);
try {
  python.runPython(`import sys; sys.path.insert(0, "/modules"); sys.dont_write_bytecode = True`);
  python.runPython(readFileSync(0, "utf8"));
} catch (error) {
  console.error(String(error.message ?? error).slice(-4000));
  process.exitCode = 1;
}
