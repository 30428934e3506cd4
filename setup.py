"""Empty the folder of an earlier build. A wheel would also contain the modules and
scenes in it that have been removed since."""

from shutil import rmtree

from setuptools import setup

rmtree("build/lib", ignore_errors=True)
setup()
