#!/usr/bin/env bash
# Makes sure that MuJoCo can render without a display: tries it, and installs what is missing where
# that is possible. Usage: headless_gl.sh PYTHON (one that has mujoco).
set -euo pipefail
python=$1
packages=(libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri libopengl0)

renders() {
  MUJOCO_GL=egl "$python" -c 'import mujoco; mujoco.GLContext(64, 64).make_current()' >/dev/null 2>&1
}

renders && exit 0
if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
  echo "Installing what rendering without a display needs: ${packages[*]}"
  apt-get update -qq
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${packages[@]}"
  renders && exit 0
fi
cat >&2 <<MESSAGE
MuJoCo can't render without a display here: EGL is missing. Videos and pictures need it.
  Debian, Ubuntu:  sudo apt-get install ${packages[*]}
  Fedora:          sudo dnf install mesa-libEGL mesa-dri-drivers libglvnd-opengl
Then run make again. Its own words:
MESSAGE
MUJOCO_GL=egl "$python" -c 'import mujoco; mujoco.GLContext(64, 64).make_current()' 2>&1 | tail -1 >&2
exit 1
