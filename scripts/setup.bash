# Sourced by ./explore and ./check: installs and builds what is missing, says what it does, and leaves a shell environment in which ROS works.
# Expects `root`, the package's folder. Exit code 2 when something is missing that cannot be installed.

say() { printf '\033[1m[setup]\033[0m %s\n' "$*" >&2; }

give_up() { printf '[setup] %s\n' "$*" >&2; exit 2; }

missing_packages() {
  local wanted
  wanted=$(sed -e 's/#.*//' -e '/^[[:space:]]*$/d' "$root/apt-packages.txt")
  # shellcheck disable=SC2086  # one word a package; dpkg-query fails where it has never heard of one
  { dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' $wanted 2>/dev/null || true; } | awk '$1 == "ii" { print $2 }' | sort -u |
    comm -13 - <(printf '%s\n' $wanted | sort -u)
}

install_packages() {
  local missing sudo=""
  missing=$(missing_packages | tr '\n' ' ')
  [ -n "$missing" ] || return 0
  if [ "$(id -u)" -ne 0 ]; then
    sudo -n true 2>/dev/null || [ -t 0 ] && command -v sudo >/dev/null ||
      give_up "these Debian packages are missing, and this user can neither install them nor use sudo: $missing"
    sudo="sudo"
  fi
  say "installing Debian packages: $missing"
  $sudo apt-get update -qq && $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >"$root/.setup.log" 2>&1 ||
    give_up "apt-get failed for: $missing (its output is in .setup.log)"
}

fingerprint() { (cd "$root" && find "$@" -type f ! -name '*.pyc' -print0 | sort -z | xargs -0 cat | sha256sum | cut -c 1-16); }

# step STAMP_FILE FINGERPRINT WHAT COMMAND...: runs COMMAND unless its inputs are those of the last time.
step() {
  local stamp="$1" print="$2" what="$3"
  shift 3
  [ "$(cat "$stamp" 2>/dev/null)" = "$print" ] && return 0
  say "$what"
  "$@" >"$root/.setup.log" 2>&1 || { tail -n 25 "$root/.setup.log" >&2; give_up "failed: $what (its whole output is in .setup.log)"; }
  printf '%s\n' "$print" >"$stamp"
}

create_venv() {
  [ -x "$root/.venv/bin/python" ] || /usr/bin/python3 -m venv --system-site-packages "$root/.venv"
  "$root/.venv/bin/pip" install --disable-pip-version-check -r "$root/requirements.txt"
}

build_workspace() {
  # Links to the package's parts, not to its folder: that one holds .ws, and a loop of links confuses rosrun.
  [ -L "$root/.ws/src/explore_3dnav" ] && rm "$root/.ws/src/explore_3dnav"
  mkdir -p "$root/.ws/src/explore_3dnav"
  local part
  for part in CMakeLists.txt check_robot package.xml setup.py config launch msg nodes octree_binding src srv test urdf; do
    ln -sfn "$root/$part" "$root/.ws/src/explore_3dnav/$part"
  done
  touch "$root/.ws/.catkin_workspace"
  (cd "$root/.ws" && env -u PYTHONPATH PATH="$root/.venv/bin:/usr/bin:/bin" catkin_make --force-cmake -DPYTHON_EXECUTABLE="$root/.venv/bin/python3" -DCMAKE_BUILD_TYPE=Release -DCOMPILE_KERNELS=OFF)
}

compile_kernels() { "$root/.venv/bin/python" "$root/scripts/compile_kernels.py"; }

load_workspace() {
  # shellcheck disable=SC1091
  source "$root/.ws/devel/setup.bash"
}

install_packages
step "$root/.venv/.setup-stamp" "$(fingerprint requirements.txt)" "installing Python packages into .venv (about a minute the first time)" create_venv
step "$root/.ws/.setup-stamp" "$(fingerprint CMakeLists.txt package.xml setup.py msg srv octree_binding)-$(ls "$root/nodes" "$root/src" | sha256sum | cut -c 1-8)" \
  "building the catkin workspace in .ws (about a minute the first time)" build_workspace
set +u
load_workspace # without arguments: catkin's setup.bash takes those of its caller for its own, --help for example
set -u
export PATH="$root/.venv/bin:$PATH" ROS_HOSTNAME="${ROS_HOSTNAME:-localhost}" PYTHONUNBUFFERED=1
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}" OMP_WAIT_POLICY="${OMP_WAIT_POLICY:-passive}"
step "$root/.ws/.kernels-stamp" "$(fingerprint $(cd "$root" && grep -rl njit src --include='*.py'))" "compiling the numba kernels" compile_kernels
