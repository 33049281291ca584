#!/usr/bin/env bash
# Makes the API reference, build/api/html/index.html, from the headers' docstrings. A warning is an error.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

scripts/setup.sh packages-docs.txt
mkdir -p build/api
doxygen docs/Doxyfile
echo "api reference: build/api/html/index.html"
