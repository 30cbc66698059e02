#!/bin/bash
# The oracle: tdac's own controller, which observes only what every controller observes.
set -euo pipefail
solution=$(cd "$(dirname "$0")" && pwd)
cp "$solution/controller.py" "${solution%/solution}/app/controller.py"
