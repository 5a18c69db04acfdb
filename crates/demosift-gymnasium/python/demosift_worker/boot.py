"""Starts a worker: its modules are the texts on its command line, a name and a text each, after its parent's process number."""

import importlib.util
import sys

PACKAGE = "demosift_worker"


class Texts:
    """Finds modules among texts, and runs one when it is first imported: a trainer needs none of an environment."""

    def __init__(self, texts):
        self.texts = texts

    def find_spec(self, name, path=None, target=None):
        package, _, part = name.partition(".")
        if package == PACKAGE and (not part or part in self.texts):
            return importlib.util.spec_from_loader(name, self, is_package=not part)
        return None

    def create_module(self, spec):
        return None

    def exec_module(self, module):
        text = self.texts.get(module.__name__.partition(".")[2], "")
        exec(compile(text, f"<{module.__name__}>", "exec"), vars(module))


sys.meta_path.insert(0, Texts(dict(zip(sys.argv[2::2], sys.argv[3::2]))))
del sys.argv[2:]

from demosift_worker.worker import main

main()
