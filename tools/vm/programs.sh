# Sourced by tools/vm-test.sh: builds what runs in the machines, and packs it with its libraries.
# shellcheck shell=bash disable=SC2154  # root, vm: tools/vm-test.sh

# build_into FOLDER TARGETS [CMAKE ARGUMENT...]: TARGETS are words in one argument.
build_into() {
  local folder=$1 targets=$2 started=$SECONDS
  shift 2
  quiet "$folder/configure.log" cmake -S "$root" -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo \
    -DCMAKE_CXX_FLAGS_RELWITHDEBINFO="-O1 -D_GLIBCXX_ASSERTIONS" \
    -DTM485_WERROR=ON -DTM485_WITH_CAIRO=OFF -DTM485_BUILD_TESTS=OFF -DTM485_BUILD_BENCH=OFF -DTM485_INSTALL=OFF \
    -DTM485_BUILD_VM_PROGRAMS=ON "$@" || return
  # shellcheck disable=SC2086  # words
  quiet "$folder/build.log" cmake --build "$folder" --parallel "$jobs" --target $targets || return
  printf 'built %s in %d s\n' "${folder#"$root/"}" $((SECONDS - started))
}

# needed_by FILE: the names of the libraries that it is linked with.
needed_by() { readelf -d "$1" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p'; }

# find_library NAME FOLDER...: its path, from the first folder that has it.
find_library() {
  local name=$1 folder
  shift
  for folder in "$@"; do
    [[ ! -e $folder/$name ]] || { printf '%s\n' "$folder/$name" && return; }
  done
  printf 'no %s in %s\n' "$name" "$*" >&2
  return 1
}

# add_libraries TREE FILE FOLDER...: what FILE needs, and what that needs, goes into TREE/lib.
add_libraries() {
  local tree=$1 file=$2 name found
  shift 2
  for name in $(needed_by "$file"); do
    [[ ! -e $tree/lib/$name ]] || continue
    found=$(find_library "$name" "$@") && cp -L "$found" "$tree/lib/$name" || return
    add_libraries "$tree" "$found" "$@" || return
  done
}

# add_program TREE FILE FOLDER...: into TREE/bin, with its libraries from the folders and the loader that it names.
add_program() {
  local tree=$1 file=$2 loader
  shift 2
  strip_for "$file" -o "$tree/bin/$(basename "$file")" && add_libraries "$tree" "$file" "$@" || return
  loader=$(readelf -l "$file" | sed -n 's/.*interpreter: \(.*\)\]/\1/p')
  [[ -n $loader && ! -e $tree$loader ]] || return 0
  mkdir -p "$tree$(dirname "$loader")"
  cp -L "$(find_library "$(basename "$loader")" "$@")" "$tree$loader"
}

# strip_for FILE ARGUMENT...: strip of the machine that FILE is for.
strip_for() {
  local file=$1 tool=strip
  shift
  [[ $(readelf -h "$file") != *AArch64* ]] || tool=aarch64-linux-gnu-strip
  "$tool" "$@" "$file"
}

# new_tree NAME BUSYBOX: an empty file system for the machine NAME with its checks; sets `tree`.
new_tree() {
  tree=$vm/tree-$1
  rm -rf "$tree"
  mkdir -p "$tree"/{bin,dev,lib,proc,sys,tmp} &&
    cp "$2" "$tree/bin/busybox" &&
    install -m 755 "$root/tools/vm/guest/init" "$tree/init" &&
    cp "$root/tools/vm/guest/checks.sh" "$vm/eeprom.bin" "$tree" &&
    cp "$root/tools/vm/guest/$1.sh" "$tree/checks"
}

pack_tree() { (cd "$tree" && find . | cpio --create --format=newc --quiet | gzip -1) >"$tree.gz"; }
