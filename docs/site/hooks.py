"""The site has the repository's own paths, so that a link which works in the repository works on the site as well.

MkDocs wants all pages in one folder; ours lie where they belong. `on_files` gives it every page under its path from the
root, and the pictures and other files that pages link to. What is in docs/site/static goes to the root of the site.
"""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent.parent
PACKAGE = ROOT / "src" / "sleepcast"
PLAYGROUND = ROOT / "docs" / "site" / "playground.py"
PYODIDE = ("pyodide.mjs", "pyodide.asm.mjs", "pyodide.asm.wasm", "python_stdlib.zip", "pyodide-lock.json")
"""What Pyodide needs in a browser."""
PACKAGES = ROOT / ".venv-docs" / "node_modules"
"""What `go.py docs` has fetched from npm, as requirements/npm says."""
PAGES = ("*.md", "docs/**/*.md", "src/**/*.md", "benchmarks/*.md", "clients/*/*.md", "examples/*/*.md")
LINK = re.compile(r"\]\(([^)\s#]+)|<img src=\"([^\"]+)\"")
FENCE = re.compile(r"^```(\w[\w-]*)(?: (\S+))?$", re.MULTILINE)
LISP = ("sleep", "finding", "explain", "bravo", "bravo-fault", "classic", "faithful", "appendix-a")
COLOURED = {**dict.fromkeys(LISP, "common-lisp"), "terminal": "console", "air": "console"}
"""As what the sorts of fenced blocks (see tests/test_docs.py) are coloured that the highlighter does not know."""
BOX = """<div id="playground" class="playground">
<p>With a server, such as <code>python3 -m http.server</code> in the site's folder, expressions can be tried here.</p>
</div>
<script type="module" src="../playground/box.js"></script>"""
"""Where static/playground/box.js builds the playground."""
HISTORY = {"CHANGELOG.md", "docs/decisions.md"}
"""Pages that name everything: a search shows them last."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    config.mdx_configs.setdefault("toc", {})["slugify"] = slug
    return config


def slug(title: str, separator: str) -> str:
    """The anchor of a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", separator)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    pages = sorted({page for pattern in PAGES for page in ROOT.glob(pattern)})
    linked = {target for page in pages for target in linked_files(page)}
    for path in (*pages, *sorted(linked)):
        files.append(File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path)))
    others = {
        "icon.svg": PACKAGE / "console" / "static" / "icon.svg",
        "vendor/iframe-worker.js": PACKAGES / "iframe-worker" / "shim" / "index.js",
        **{f"vendor/pyodide/{name}": PACKAGES / "pyodide" / name for name in PYODIDE},
    }
    for place, path in others.items():
        files.append(File.generated(config, place, abs_src_path=str(path)))
    files.append(File.generated(config, "playground/sleepcast.zip", content=packed()))
    return files


def packed() -> bytes:
    """The archive that the playground's Python imports from: the language, and what it needs."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(PLAYGROUND, PLAYGROUND.name)
        for path in sorted([PACKAGE / "__init__.py", *PACKAGE.glob("core/*.py"), *PACKAGE.glob("language/*.py")]):
            archive.write(path, path.relative_to(PACKAGE.parent))
    return content.getvalue()


def linked_files(page: Path) -> set[Path]:
    """The files besides pages that a page links to or shows."""
    found = set()
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        target = (page.parent / "".join(link)).resolve()
        if target.is_file() and target.suffix != ".md" and target.is_relative_to(ROOT):
            found.add(target)
    return found


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Prepare a page's text: the colours and titles of its fenced blocks, and on one page the playground."""
    if page.file.src_uri in HISTORY:
        page.meta["search"] = {"boost": 0.1}
    markdown = FENCE.sub(fence, markdown)
    if page.file.src_uri == "docs/language.md":
        markdown = markdown.replace("\n## ", f"\n{BOX}\n\n## ", 1)
    return markdown


def fence(match: re.Match[str]) -> str:
    """The first line of a fenced block, as the highlighter wants it."""
    sort, file = match[1], match[2] and match[2].removeprefix("excerpt=").replace(":", ": ")
    title = f' title="{file}"' if file else ""
    return f"```{{.{COLOURED.get(sort, sort)} .{sort}{title}}}"
