#!/bin/sh
# The report needs LaTeX. Where it is missing: install it if this is Debian and we may, else say how.
set -eu

packages='latexmk texlive-latex-recommended lmodern'

if command -v latexmk >/dev/null && command -v pdflatex >/dev/null && kpsewhich lmodern.sty booktabs.sty >/dev/null; then
    exit 0
elif ! command -v apt-get >/dev/null; then
    echo "homing: the report needs LaTeX; install what Debian calls $packages, then run: make paper" >&2
    exit 1
elif [ "$(id -u)" -eq 0 ]; then
    as_root=
elif sudo -n true 2>/dev/null; then
    as_root='sudo'
else
    echo "homing: the report needs LaTeX; run: sudo apt-get install --no-install-recommends $packages" >&2
    exit 1
fi

# Another installation may be at work, as on a machine that was just started: wait for it.
patient='-o DPkg::Lock::Timeout=600'
tries=0
until $as_root apt-get $patient update -q; do # whose own lock it does not wait for
    tries=$((tries + 1))
    if [ $tries -eq 20 ]; then
        echo "homing: the packages of LaTeX cannot be listed; all but the report is made; later: make paper" >&2
        exit 1
    fi
    sleep 15
done
$as_root env DEBIAN_FRONTEND=noninteractive apt-get $patient install -q -y --no-install-recommends $packages || {
    echo "homing: LaTeX cannot be had here; all but the report is made; later: make paper" >&2
    exit 1
}
