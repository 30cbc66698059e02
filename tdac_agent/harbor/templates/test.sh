#!/bin/bash
# Judges /app/controller.py with tdac and writes /logs/verifier/reward.json.
set -euo pipefail
tests=$(cd "$(dirname "$0")" && pwd)
root=${tests%/tests}
# -I: Python imports nothing from the working folder.
exec python3 -I -m tdac_agent.harbor.judge "$root/app/controller.py" "$tests" "$root/logs/verifier"
