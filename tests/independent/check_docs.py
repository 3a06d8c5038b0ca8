"""Every public item has an example that runs, or says whose example shows it ("See the example of …").

    cargo doc --release --no-deps && python tests/independent/check_docs.py target/doc/softjam

Reads the pages that rustdoc wrote: functions, structs, enums, traits, constants, and their own methods. Fields and variants are
explained where they stand; a module needs an example unless it is only a room for others.
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path

KINDS = ("fn", "struct", "enum", "trait", "constant", "type", "macro")
VOID = {"br", "hr", "img", "input", "link", "meta", "wbr", "col"}


class Page(HTMLParser):
    """The docs of a page's item (key "") and of each of its methods."""

    def __init__(self):
        super().__init__()
        self.stack = []
        self.docs = {"": ""}
        self.method = ""
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
            self.method = identity
            self.docs.setdefault(self.method, "")
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
        if self.foreign is None and any("docblock" in classes for _, classes in self.stack):
            self.docs[self.method] += text


def shows(docs):
    return "```" in docs or re.search(r"See the\s+(example|module)", docs)


def main():
    root = Path(sys.argv[1])
    items, lacking = 0, []
    for path in sorted(root.rglob("*.html")):
        kind = path.name.split(".")[0]
        is_module = path.name == "index.html"
        if kind not in KINDS and not is_module:
            continue
        text = path.read_text()
        if 'http-equiv="refresh"' in text:
            continue
        page = Page()
        page.feed(text)
        where = "::".join(path.relative_to(root).with_suffix("").parts)
        # A room whose modules have the examples.
        if is_module:
            room = any(path.parent.glob("*/index.html"))
            items += 1
            own = [p for p in path.parent.glob("*.html") if p.name.split(".")[0] in KINDS]
            if not (room or own or shows(page.docs[""])):
                lacking.append(where)
            continue
        for method, docs in page.docs.items():
            items += 1
            if not shows(docs):
                lacking.append(f"{where} {method}".strip())
    print(f"{items} public items, {len(lacking)} without an example or whose it is")
    for item in lacking:
        print(f"  {item}")
    if items < 100:
        sys.exit(f"{root} holds too few items to be the documentation of softjam")
    sys.exit(1 if lacking else 0)


main()
