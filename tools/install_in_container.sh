#!/bin/sh
# Installs tdac from a folder into a virtual environment of its own, and compiles
# everything for all users: the steps of the Dockerfile, which a test runs, too.
#   sh tools/install_in_container.sh SOURCE PREFIX
set -eu
source=$1 prefix=$2
python3 -m venv "$prefix"
"$prefix/bin/pip" install --no-cache-dir --quiet "$source"
"$prefix/bin/tdac" warm
"$prefix/bin/tdac" doctor
