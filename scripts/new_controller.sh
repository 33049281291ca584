#!/usr/bin/env bash
# new_controller.sh NAME: adds a controller to this tree and builds it. new_controller.sh --out DIR NAME: makes a project
# of its own outside of the tree. docs/writing-a-controller.md explains what it writes.
exec python3 "$(dirname "$(realpath "$0")")/new_controller.py" "$@"
