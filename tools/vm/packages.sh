# Sourced by tools/vm-test.sh: the Debian packages that are unpacked beside the system, into build/vm. Nothing is
# installed and no root is needed: apt works with lists and a cache of its own, on the machine's sources.
# shellcheck shell=bash disable=SC2034,SC2154  # vm, online, reason: tools/vm-test.sh

# apt_of ARCH apt-get|apt-cache ARGUMENT...
apt_of() {
  local arch=$1 command=$2 state=$vm/apt-$1
  shift 2
  "$command" -q -o APT::Architecture="$arch" -o APT::Architectures="$arch" -o APT::Sandbox::User=root \
    -o Dir::State="$state" -o Dir::State::lists="$state/lists" -o Dir::State::status="$state/status" \
    -o Dir::Cache="$state/cache" -o Acquire::Retries=3 -o Acquire::Languages=none "$@"
}

# update_lists ARCH: once a run.
update_lists() {
  local state=$vm/apt-$1
  [[ ! -e $state/updated ]] || return 0
  mkdir -p "$state/lists/partial" "$state/cache/archives/partial"
  : >"$state/status"
  quiet "$state/update.log" apt_of "$1" apt-get update && : >"$state/updated"
}

# kernel_of ARCH: the version that Debian's kernel package for it stands for, such as 6.1.0-40-amd64.
kernel_of() {
  apt_of "$1" apt-cache depends "linux-image-$1" | sed -n 's/^ *Depends: linux-image-//p' | head -n 1
}

# download ARCH PACKAGE...: into build/vm/debs-ARCH
download() {
  local arch=$1
  shift
  mkdir -p "$vm/debs-$arch"
  (cd "$vm/debs-$arch" && quiet "$vm/apt-$arch/download.log" apt_of "$arch" apt-get download "$@")
}

# unpack ARCH PACKAGE [MEMBER...]: the whole package, or what matches, into build/vm/root-ARCH
unpack() {
  local arch=$1 package=$2
  shift 2
  dpkg --fsys-tarfile "$vm/debs-$arch/$package"_*.deb |
    tar -x -C "$vm/root-$arch" ${1:+--wildcards --no-anchored "$@"}
}

# fetched ARCH: true if everything is there from an earlier run.
fetched() { [[ -e $vm/root-$1/.complete ]] && kernel=$(<"$vm/root-$1/.complete"); }

# fetch ARCH: fills build/vm/root-ARCH and sets `kernel`. Afterwards no network is needed.
fetch() {
  local arch=$1
  fetched "$arch" && return
  ((online)) || { reason="the packages for $arch are not in build/vm, and --cached forbids to fetch them" && return 1; }
  reason="the packages for $arch could not be fetched"
  rm -rf "$vm/root-$arch" "$vm/debs-$arch"
  mkdir -p "$vm/root-$arch"
  update_lists "$arch" && kernel=$(kernel_of "$arch") && [[ -n $kernel ]] && "fetch_$arch" &&
    printf '%s\n' "$kernel" >"$vm/root-$arch/.complete" && rm -rf "$vm/debs-$arch"
}

# Kernel, and what gpio-sim is made from: Debian's kernels do not contain it.
fetch_amd64() {
  local headers="linux-headers-$kernel" series source package
  series=$(cut -d. -f1,2 <<<"$kernel")
  source="linux-source-$series"
  local others=("$headers" "linux-headers-${kernel%-amd64}-common" "linux-kbuild-$series")
  download amd64 "linux-image-$kernel" "$source" "${others[@]}" || return
  unpack amd64 "linux-image-$kernel" "vmlinuz-$kernel" configfs.ko || return
  unpack amd64 "$source" "$source.tar.xz" || return
  for package in "${others[@]}"; do
    unpack amd64 "$package" || return
  done
  local sources=$vm/root-amd64/usr/src
  tar -xJf "$sources/$source.tar.xz" -C "$sources" \
    "$source"/{drivers/gpio/{gpio-sim.c,gpiolib.h},kernel/irq/irq_sim.c} || return
  rm "$sources/$source.tar.xz"
  # The headers' Makefile names the common ones by an absolute path.
  sed -i "s,/usr/src/,$sources/," "$sources/$headers/Makefile"
}

# Kernel, a shell, and the libraries that the command is linked with.
fetch_arm64() {
  local package packages=(busybox-static libcli11-dev libeigen3-dev libfmt-dev libfmt9 libgpiod-dev libgpiod2
    libtomlplusplus-dev libtomlplusplus3 nlohmann-json3-dev zlib1g zlib1g-dev)
  download arm64 "linux-image-$kernel" "${packages[@]}" || return
  unpack arm64 "linux-image-$kernel" "vmlinuz-$kernel" || return
  for package in "${packages[@]}"; do
    unpack arm64 "$package" || return
  done
}

# build_gpio_sim: build/vm/gpio-sim/gpio-sim.ko, for the kernel of amd64, from Debian's own source.
build_gpio_sim() {
  local folder=$vm/gpio-sim source
  [[ ! -e $folder/gpio-sim.ko || $folder/gpio-sim.ko -ot $vm/root-amd64/.complete ]] || return 0
  source=$(echo "$vm"/root-amd64/usr/src/linux-source-*)
  rm -rf "$folder"
  mkdir -p "$folder"
  cp "$source/drivers/gpio/gpiolib.h" "$folder"
  cp "$source/drivers/gpio/gpio-sim.c" "$folder/gpio-sim-main.c"
  # In the kernel irq_sim is built in. A module may not call irq_to_desc(); what it may call does the same.
  sed 's/handle_simple_irq(irq_to_desc(\(\w*\)))/generic_handle_irq(\1)/' "$source/kernel/irq/irq_sim.c" >"$folder/irq-sim.c"
  printf '%s\n' 'obj-m := gpio-sim.o' 'gpio-sim-y := gpio-sim-main.o irq-sim.o' >"$folder/Kbuild"
  quiet "$folder/build.log" make -C "$vm/root-amd64/usr/src/linux-headers-$kernel" M="$folder" modules &&
    strip --strip-debug "$folder/gpio-sim.ko"
}
