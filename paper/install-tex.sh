#!/bin/sh
# The report needs LaTeX, and the lectures its package Beamer, which draws with TikZ. Where they are missing: install them
# if this is Debian and we may, else say how.
# Usage: install-tex.sh [lectures]
set -eu

packages='latexmk texlive-latex-recommended lmodern'
if [ "${1-}" = lectures ]; then
    product='the lectures' need='need' others= again='make lectures' styles='lmodern.sty booktabs.sty beamer.cls tikz.sty'
    packages="$packages texlive-pictures"
else
    product='the report' need='needs' others='all but the report is made; ' again='make paper' styles='lmodern.sty booktabs.sty'
fi

if command -v latexmk >/dev/null && command -v pdflatex >/dev/null && kpsewhich $styles >/dev/null; then
    exit 0
elif ! command -v apt-get >/dev/null; then
    echo "homing: $product $need LaTeX; install what Debian calls $packages, then run: $again" >&2
    exit 1
elif [ "$(id -u)" -eq 0 ]; then
    as_root=
elif sudo -n true 2>/dev/null; then
    as_root='sudo'
else
    echo "homing: $product $need LaTeX; run: sudo apt-get install --no-install-recommends $packages" >&2
    exit 1
fi

# Another installation may be at work, as on a machine that was just started: wait for it.
patient='-o DPkg::Lock::Timeout=600'
tries=0
until $as_root apt-get $patient update -q; do # whose own lock it does not wait for
    tries=$((tries + 1))
    if [ $tries -eq 20 ]; then
        echo "homing: the packages of LaTeX cannot be listed; ${others}later: $again" >&2
        exit 1
    fi
    sleep 15
done
$as_root env DEBIAN_FRONTEND=noninteractive apt-get $patient install -q -y --no-install-recommends $packages || {
    echo "homing: LaTeX cannot be had here; ${others}later: $again" >&2
    exit 1
}
