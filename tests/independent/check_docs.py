"""There is an example that runs where one teaches something, or a pointer to it ("See the example of …").

    cargo doc --release --no-deps && python tests/independent/check_docs.py target/doc/softjam

Reads the pages that rustdoc wrote. An example is asked of every module, every free function, and every struct, enum and trait that has
methods of its own. Methods, fields, variants, constants and plain data are explained where they stand.
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path

KINDS = ("fn", "struct", "enum", "trait")
VOID = {"br", "hr", "img", "input", "link", "meta", "wbr", "col"}


class Page(HTMLParser):
    """The docs of a page's item, without those of its methods, and whether it has any of its own."""

    def __init__(self):
        super().__init__()
        self.stack = []
        self.docs = ""
        self.methods = False
        self.foreign = None  # depth of a list of trait implementations

    def handle_starttag(self, tag, attributes):
        if tag in VOID:
            return
        a = dict(attributes)
        classes = (a.get("class") or "").split()
        identity = a.get("id") or ""
        self.stack.append((tag, classes))
        if self.foreign is None and identity in (
            "trait-implementations-list",
            "synthetic-implementations-list",
            "blanket-implementations-list",
        ):
            self.foreign = len(self.stack)
        if self.foreign is None and tag == "section" and re.match(r"(ty)?method\.", identity):
            self.methods = True
        if "example-wrap" in classes and "rust-example-rendered" not in classes:
            self.note("```")

    def handle_endtag(self, tag):
        if tag in VOID:
            return
        while self.stack:
            if self.stack.pop()[0] == tag:
                break
        if self.foreign is not None and len(self.stack) < self.foreign:
            self.foreign = None

    def handle_data(self, text):
        self.note(text)

    def note(self, text):
        # Docs of methods and fields are no "top-doc".
        if any("top-doc" in classes for _, classes in self.stack):
            self.docs += text


def shows(docs):
    return "```" in docs or re.search(r"See the\s+(example|module)", docs)


def main():
    root = Path(sys.argv[1])
    asked, lacking = {"module": 0, **dict.fromkeys(KINDS, 0)}, []
    for path in sorted(root.rglob("*.html")):
        kind = "module" if path.name == "index.html" else path.name.split(".")[0]
        if kind not in asked:
            continue
        text = path.read_text()
        if 'http-equiv="refresh"' in text:
            continue
        page = Page()
        page.feed(text)
        if kind in ("struct", "enum", "trait") and not page.methods:
            continue
        asked[kind] += 1
        if not shows(page.docs):
            lacking.append("::".join(path.relative_to(root).with_suffix("").parts))
    counts = ", ".join(f"{count} of kind {kind}" for kind, count in asked.items())
    print(f"examples asked of {counts}; {len(lacking)} lack one or a pointer to it")
    for item in lacking:
        print(f"  {item}")
    if min(asked.values()) == 0 or sum(asked.values()) < 100:
        sys.exit(f"{root} holds too few items to be the documentation of softjam")
    sys.exit(1 if lacking else 0)


main()
