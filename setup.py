"""Modules and scenes that a pull took away would be packed from the folder of an
earlier build, too."""

from shutil import rmtree

from setuptools import setup

rmtree("build/lib", ignore_errors=True)
setup()
