# Sourced by the rigs: Debian's full kernel under QEMU, without root, KVM or installing anything.
# One kernel serves all: the cloud kernel has neither CAN nor USB gadgets.

skip() { echo "SKIPPED ALOUD: $*"; exit 77; }

# fetch CACHE: downloads QEMU (with the libraries that this machine lacks), busybox and the kernel, and unpacks them.
fetch() {
  local cache=$1 qemu kernel lock sandbox=()
  # Two rigs may begin at once.
  exec {lock}>"$cache/lock"
  flock "$lock"
  [ ! -e "$cache/complete" ] || { exec {lock}>&-; return 0; }
  [ "$(uname -m)" = x86_64 ] || skip "the rig boots an x86_64 kernel, this machine is $(uname -m)"
  command -v apt-get >/dev/null && command -v dpkg >/dev/null || skip "apt-get and dpkg are not on this machine"
  # -s only lists. Packages that would be upgraded are left out: a second libc beside the machine's own breaks QEMU.
  qemu=$(apt-get install -s --no-install-recommends qemu-system-x86 2>"$cache/apt.log" | awk '/^Inst/ && $3 !~ /^\[/ {print $2}') \
    || skip "apt-get does not know qemu-system-x86 ($(tail -n 1 "$cache/apt.log")); has apt-get update been run?"
  kernel=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: \(linux-image-[0-9][^ ]*\).*/\1/p' | head -n 1)
  [ -n "$kernel" ] || skip "apt-cache does not know linux-image-amd64; this needs Debian's package lists"
  [ "$(id -u)" != 0 ] || sandbox=(-o APT::Sandbox::User=root)
  rm -rf "$cache/debs" "$cache/root" "$cache/kernel"
  mkdir -p "$cache/debs" "$cache/root" "$cache/kernel"
  # shellcheck disable=SC2086 # a list of names
  (cd "$cache/debs" && apt-get "${sandbox[@]}" download $qemu busybox-static "$kernel" >"$cache/apt.log" 2>&1) \
    || skip "apt-get download failed: $(grep '^E:' "$cache/apt.log" | head -n 1)"
  for deb in "$cache"/debs/*.deb; do
    case $deb in */linux-image*) dpkg -x "$deb" "$cache/kernel" ;; *) dpkg -x "$deb" "$cache/root" ;; esac
  done
  rm -rf "$cache/debs"
  touch "$cache/complete"
  exec {lock}>&-
}

# fetch_with_needs CACHE PACKAGE: a program's package with what it needs and this machine lacks, unpacked beside QEMU; false where it cannot be had.
fetch_with_needs() (
  cache=$1 name=$2 sandbox=()
  # Rigs share the folder and may run beside each other; the lock is let go with this shell.
  exec {lock}>"$cache/lock"
  flock "$lock"
  [ ! -e "$cache/complete-$name" ] || return 0
  packages=$(apt-get install -s --no-install-recommends "$name" 2>"$cache/apt.log" | awk '/^Inst/ && $3 !~ /^\[/ {print $2}') || return 1
  [ -n "$packages" ] || packages=$name
  [ "$(id -u)" != 0 ] || sandbox=(-o APT::Sandbox::User=root)
  rm -rf "$cache/debs" && mkdir -p "$cache/debs"
  # shellcheck disable=SC2086 # a list of names
  (cd "$cache/debs" && apt-get "${sandbox[@]}" download $packages >"$cache/apt.log" 2>&1) || return 1
  for deb in "$cache"/debs/*.deb; do dpkg -x "$deb" "$cache/root"; done
  rm -rf "$cache/debs"
  touch "$cache/complete-$name"
)

# add_debian_program CACHE TREE PATH: a program that was unpacked, with its libraries from there or from this machine.
add_debian_program() {
  local root=$1/root file
  install -D -m 755 "$root/$3" "$2/bin/$(basename "$3")"
  { LD_LIBRARY_PATH=$root/usr/lib/x86_64-linux-gnu:$root/lib/x86_64-linux-gnu ldd "$root/$3" || true; } | { grep -o '/[^ ]*\.so[^ ]*' || true; } \
    | while read -r file; do install -D -m 755 "$file" "$2${file#"$root"}"; done
}

# begin_tree CACHE TREE INIT: the machine's file system with its first process, which sources /prelude.
begin_tree() {
  mkdir -p "$2"/{bin,dev,proc,sys,tmp,lib/modules,lib64}
  chmod 755 "$2" # mktemp makes it 0700, and then it is closed to everyone but root in the machine
  install -m 755 "$3" "$2/init"
  install -m 755 tests/vm/prelude "$2/prelude"
  install -m 755 "$1/root/bin/busybox" "$2/bin/busybox"
  : >"$2/lib/modules/order"
}

# add_program TREE FILE: a program with the libraries that it is linked to, without its symbols.
add_program() {
  local file
  strip -o "$1/bin/$(basename "$2")" "$2"
  { ldd "$2" 2>/dev/null || true; } | { grep -o '/[^ ]*\.so[^ ]*' || true; } | while read -r file; do
    install -D -m 755 "$file" "$1$file"
  done
}

# add_python TREE PACKAGES SCRIPT: this machine's Python with what a script of two arguments loads before its main part, from PACKAGES and from
# Python's own library, compiled, and a program of the script's name.
add_python() {
  local script=$3 name python prefix file
  name=$(basename "$script" .py)
  python=$(python3 -c 'import os, sys; print(os.path.realpath(sys.executable))')
  prefix=$(python3 -c 'import sys; print(sys.base_prefix)')
  add_program "$1" "$python"
  install -D -m 644 "$script" "$1/python/$name.py"
  # -S: nothing of this machine's own packages.
  PYTHONPATH=$2:$(dirname "$script") PYTHONDONTWRITEBYTECODE=1 python3 -S -c "
import sys, $name, can.interfaces.socketcan, encodings.idna, encodings.ascii, encodings.latin_1
print(*{m.__file__ for m in sys.modules.values() if getattr(m, '__file__', None)}, sep='\n')" | grep -v "/$name.py\$" | while read -r file; do
    case $file in "$2"/*) install -D -m 644 "$file" "$1/python/${file#"$2"/}" ;; *) install -D -m 644 "$file" "$1$file" ;; esac
    case $file in *.so) { ldd "$file" 2>/dev/null || true; } | { grep -o '/[^ ]*\.so[^ ]*' || true; } | while read -r library; do
      [ -e "$1$library" ] || install -D -m 755 "$library" "$1$library"
    done ;; esac
  done
  # Packages say their version by their folder of metadata.
  (cd "$2" && find . -path './*.dist-info/METADATA' -exec cp --parents {} "$1/python" \;)
  mkdir -p "$1$prefix/$(python3 -c 'import sys; print("lib/python%d.%d/lib-dynload" % sys.version_info[:2])')"
  # Without a date of their sources, which the machine's file system does not keep.
  python3 -m compileall -q --invalidation-mode unchecked-hash "$1/python" "$1$prefix/lib"
  printf '#!/bin/sh\nPYTHONHOME=%s PYTHONPATH=/python exec /bin/%s -S /python/%s.py "$@"\n' "$prefix" "$(basename "$python")" "$name" \
    >"$1/bin/$name"
  chmod 755 "$1/bin/$name"
}

# add_module CACHE TREE NAME: a kernel module, behind those that it needs.
add_module() {
  local name=${3//_/-} file need needs
  ! grep -qx "$name" "$2/lib/modules/order" || return 0
  file=$(find "$1/kernel/lib/modules" -name "$name.ko*" -o -name "${name//-/_}.ko*" | head -n 1)
  [ -n "$file" ] || { echo "the kernel package holds no module $name"; exit 1; }
  case $file in *.xz) xz -dc "$file" >"$2/lib/modules/$name.ko" ;; *) cp "$file" "$2/lib/modules/$name.ko" ;; esac
  needs=$(tr '\0' '\n' <"$2/lib/modules/$name.ko" | sed -n 's/^depends=//p' | head -n 1)
  for need in ${needs//,/ }; do add_module "$1" "$2" "$need"; done
  echo "$name" >>"$2/lib/modules/order"
}

# A machine that has printed nothing for so long stands still with its clock: a part that does not end is told by its own alarm before. One
# that waits uses some processor time all the same, for its kernel's ticks, also beside others that take all they can; one that has used
# none for so long has stopped for good.
STILL_S=${VM_STILL_S:-900}
UNUSED_S=${VM_UNUSED_S:-120}

# boot CACHE TREE CONSOLE CLOCK SECONDS WORDS [OPTION...]: runs the machine until it switches off. CLOCK is QEMU's -icount: with
# shift=N an instruction takes 2^N ns, with sleep=off the machine never waits, with sleep=on it waits as long as the host does. OPTIONs
# are QEMU's. One that stands still is ended and booted once more: that is QEMU's doing, and says nothing of krait.
boot() {
  local code=0
  boot_once "$@" || code=$?
  [ "$code" = 75 ] || return "$code"
  tail -n 3 "$3"
  cp "$3" "$3.still"
  echo "the machine stands still ($(cat "$2.still")) and is booted once more; its console until then: $3.still"
  boot_once "$@"
}

# The same once; 75 where it stands still.
boot_once() {
  local usr=$1/root/usr qemu=(qemu-system-x86_64) watcher code=0
  (cd "$2" && find . | "$1/root/bin/busybox" cpio -o -H newc 2>/dev/null) >"$2.cpio"
  if [ -x "$usr/bin/qemu-system-x86_64" ]; then
    qemu=(env "LD_LIBRARY_PATH=$usr/lib/x86_64-linux-gnu:$1/root/lib/x86_64-linux-gnu" "$usr/bin/qemu-system-x86_64")
    qemu+=(-L "$usr/share/qemu" -L "$usr/share/seabios")
  fi
  rm -f "$2.pid" "$2.still"
  : >"$3"
  end_where_still "$2" "$3" >/dev/null 2>&1 &
  watcher=$!
  # One processor whose clock counts instructions: a busy host makes it slower, not later.
  # In this process group, so that whoever ends the rig ends the machine. A line of its console is in the file when it has been printed.
  timeout --foreground "$5" "${qemu[@]}" -accel tcg -icount "$4" -M pc -cpu max -m 512 -nodefaults -no-user-config \
    -display none -serial stdio -no-reboot -pidfile "$2.pid" -kernel "$(find "$1/kernel/boot" -name 'vmlinuz-*' | head -n 1)" \
    -initrd "$2.cpio" -append "console=ttyS0 panic=-1 quiet $6" "${@:7}" </dev/null 2>&1 | sed -u 's/\r//g' >"$3" || code=$?
  kill "$watcher" 2>/dev/null || true
  [ ! -e "$2.still" ] || code=75
  return "$code"
}

# end_where_still TREE CONSOLE: ends the machine and says so by a file, where nothing is printed any more or no processor time is used; runs
# beside it.
end_where_still() {
  local now used newest='' since why
  since=$(date +%s)
  while sleep 5 && kill -0 $$; do
    now=$(date +%s)
    used=$(awk '{ print $14 + $15 }' "/proc/$(cat "$1.pid")/stat") || used=''
    [ -n "$used" ] && [ "$used" = "$newest" ] || since=$now
    newest=$used
    if [ $((now - $(stat -c %Y "$2"))) -gt "$STILL_S" ]; then
      why="it has printed nothing for $STILL_S s"
    elif [ $((now - since)) -gt "$UNUSED_S" ]; then
      why="it has used no processor time for $UNUSED_S s"
    else
      continue
    fi
    echo "$why" >"$1.still"
    kill -KILL "$(cat "$1.pid")"
    return
  done
}
