# The whole project on one page. A target stands left of the colon, what it is made from stands right.
# `make help` prints what stands behind a ##.

# The first Python that works; `make PYTHON=python3.13` takes another, and makes .venv anew.
PYTHON = $(shell for python in python3.11 python3.12 python3.13; do $$python -Ic 'import ensurepip' && echo $$python \
  && break; done 2>/dev/null)
VERSION := $(shell $(PYTHON) -Ic 'import ensurepip, sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
HOMING := .venv/bin/python -m homing_lib

# The library, by who uses it, so that an edit remakes what it touches and nothing else. No numbered notebook imports
# UNDRAWN, or of the lab its file, hints, experiments or handouts; a test compares this with their imports.
UNDRAWN := $(patsubst %,homing_lib/publish/%.py,cli compact demo film prose report site tex where)
MODEL   := $(filter-out %/__main__.py,$(wildcard homing_lib/*.*))
STUDY   := $(wildcard homing_lib/study/*.* homing_lib/study/[a-z]*/*.*)
DRAWING := $(filter-out $(UNDRAWN),$(wildcard homing_lib/publish/*.*))
TEACH   := $(filter-out %/experiments.py %/handouts.py %/lab.py %/lab.toml,$(wildcard homing_lib/teach/*.*))

NOTEBOOKS := $(patsubst notebooks/%.ipynb,%,$(wildcard notebooks/[0-9]*.ipynb))
EXECUTED  := $(NOTEBOOKS:%=.build/notebooks/%)
SLIDES    := $(patsubst paper/%.tex,.build/%.pdf,$(filter-out %/preamble.tex,$(wildcard paper/lectures/*.tex)))

# The same bytes on every run: one thread for linear algebra, fixed hashes, a fixed date in every PDF.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
export PYTHONHASHSEED := 0
export SOURCE_DATE_EPOCH := 1767225600
export FORCE_SOURCE_DATE := 1
export MPLBACKEND := Agg
export HYPOTHESIS_STORAGE_DIRECTORY := .build/hypothesis
# And nothing of a user's own set-up. Who keeps packages of LaTeX at home: make TEXMFHOME=~/texmf
export PYTHONUTF8 := 1
export MATPLOTLIBRC := /dev/null
export TEXMFHOME := /dev/null
export TEXMFCONFIG := /dev/null
export TEXMFVAR := /dev/null
export BIBINPUTS := ../../paper: # seen from where BibTeX works, .build/paper; a whole path might hold a comma
THEIRS := $(filter PYTHON% PYTEST_% MYPY% RUFF_% TEXINPUTS% TEXMFCNF% TEXFONTMAPS BASH_ENV CDPATH,$(.VARIABLES))
unexport $(filter-out PYTHONHASHSEED PYTHONUTF8,$(THEIRS))

MAKEFLAGS += --jobs=2
.DELETE_ON_ERROR:
.PHONY: all test data deep verify audit notebooks quick paper lectures demo site lab bench class compact lock clean help FORCE

# A stamp lists the files that were made, with their checksums. If one is no longer so, it goes, and they are made again.
STAMPS := $(wildcard .build/numbers .build/report .build/demo .build/pages .build/notebooks/*)
$(shell for stamp in $(STAMPS); do [ -s $$stamp ] && cut -d ' ' -f 3- $$stamp | xargs cksum | cmp -s - $$stamp || \
  rm -f $$stamp; done 2>/dev/null)

all: .build/verified .build/report .build/demo .build/summary ## everything: data, a live check, notebooks, figures, report
	@cat .build/summary .build/verified
	@echo "Report: paper/report.pdf"

# Environments. One of another Python, or that was copied or moved with its folder, is made anew.
fitting = $(or $(filter 3.11 3.12 3.13,$(VERSION)),$(error homing: '$(or $(PYTHON),python3.11)' is no Python 3.11, 3.12 \
  or 3.13 with venv; on Debian: apt-get install python3.11-venv; elsewhere: make PYTHON=/path/to/python3.11))
another = $(shell [ "$$(cat $(1)/.ready 2>/dev/null)" = "$(VERSION) $$(pwd -P)" ] || echo FORCE)

.venv/.ready: environment.lock $(call another,.venv)
	@$(if $(fitting),$(PYTHON)) .ci/environment.py .venv $<

# For lessons: whatever packages this Python gets, and PyBullet only where it has a wheel. `OPEN=` opens nothing.
.build/class/.ready: pyproject.toml $(call another,.build/class)
	@$(if $(fitting),$(PYTHON)) .ci/environment.py .build/class

# For deep learners, beside the locked packages.
.build/deep/.ready: environment.lock .ci/deep.lock $(call another,.build/deep)
	@echo ".build/deep: torch is downloaded, 2.8 GB on Linux, where it brings CUDA along; elsewhere a tenth of that"
	@$(if $(fitting),$(PYTHON)) .ci/environment.py .build/deep environment.lock .ci/deep.lock

OPEN = lab
class: .build/class/.ready ## open the notebooks in JupyterLab, on any computer: no compiler, no LaTeX
	$(if $(OPEN),env -u MPLBACKEND .build/class/bin/jupyter $(OPEN) notebooks)

# Data: always checked, in two seconds. The stamp is newer only if their content changed.
data: .build/data ## check the stored runs, compute the missing ones (all of them: make data FORCE=1)
.build/data: FORCE | .venv/.ready
	@mkdir -p .build
	$(HOMING) data --stamp $@$(if $(FORCE), --force)

# Neither `make` nor `make data` needs it: the tables of deep learners are here, and checked as all others are.
deep: .build/deep/.ready ## compute what is missing of the deep learners, PPO and DQN: downloads 2.8 GB, takes an hour or two
	.build/deep/bin/python -m homing_lib data instead instead-images$(if $(FORCE), --force)

verify: .build/verified ## repeat one stored run live and compare it to the bit
.build/verified: .build/data $(MODEL) $(STUDY) $(if $(filter verify,$(MAKECMDGOALS)),FORCE)
	$(HOMING) verify > $@.part
	@mv $@.part $@
	@cat $@

audit: .venv/.ready ## rebuild it in two clones, as a hostile reader would, and name what differs (FULL=1: all runs)
	.venv/bin/python .ci/audit.py $(if $(FULL),--full) $(if $(SEED),--seed $(SEED))

.build/summary: .build/verified homing_lib/publish/report.py
	$(HOMING) summary > $@.part
	@mv $@.part $@

# Notebooks
FOR_NOTEBOOKS := .build/data $(MODEL) $(STUDY) $(DRAWING) $(TEACH) environment.lock
notebooks: $(EXECUTED) ## execute the notebooks; they write figures/ and notebooks/executed/
.build/notebooks/%: notebooks/%.ipynb $(FOR_NOTEBOOKS)
	@mkdir -p $(@D) .build/written
	$(HOMING) notebook $* > .build/written/$*
	@xargs cksum < .build/written/$* > $@

quick: $(NOTEBOOKS:%=.build/quick/%.ipynb) ## the same in some minutes and into .build/quick, for trying changes out
.build/quick/%.ipynb: notebooks/%.ipynb $(FOR_NOTEBOOKS)
	$(HOMING) notebook $* --profile quick --output-dir .build/quick --figures-dir .build/quick/figures

# Report, and two lectures: slides, and as a second PDF each slide with three lines for the lecturer
.build/numbers: .build/data $(MODEL) $(STUDY) $(patsubst %,homing_lib/publish/%.py,report prose tex where) \
  $(NOTEBOOKS:%=notebooks/%.ipynb) paper/report.tex $(wildcard paper/lectures/*.tex)
	$(HOMING) numbers --latex > paper/numbers.tex.part
	@mv paper/numbers.tex.part paper/numbers.tex
	@cksum paper/numbers.tex > $@

# $(1): the PDF without its ending; $(2): further options. If it fails, what LaTeX says of it.
typeset = latexmk -norc -cd -g -pdf -interaction=nonstopmode -halt-on-error $(2) $< > $(1).pdf.log 2>&1 || \
	  { grep -A 5 '^!' $(1).log || tail $(1).pdf.log; exit 1; } >&2

paper: .build/report ## the report, paper/report.pdf
.build/report: paper/report.tex paper/references.bib .build/numbers $(EXECUTED)
	@paper/install-tex.sh
	@mkdir -p .build/paper
	$(call typeset,.build/paper/report,-outdir=../.build/paper)
	@! grep -E '^Overfull|undefined|^Half-empty' .build/paper/report.log >&2
	@cp .build/paper/report.pdf paper/report.pdf
	@cksum paper/report.pdf > $@

lectures: $(SLIDES) $(SLIDES:.pdf=-notes.pdf) ## two lectures on slides and their notes, paper/lectures/*.pdf
.build/lectures/%.pdf .build/lectures/%-notes.pdf: paper/lectures/%.tex paper/lectures/preamble.tex .build/numbers \
  $(EXECUTED)
	@paper/install-tex.sh lectures
	@mkdir -p $(@D)
	$(call typeset,$(@D)/$*,-outdir=../../$(@D))
	$(call typeset,$(@D)/$*-notes,-outdir=../../$(@D) -jobname=$*-notes -usepretex='\def\withnotes{}')
	@cp $(@D)/$*.pdf $(@D)/$*-notes.pdf paper/lectures

# For browsers and for the class
demo: .build/demo ## the demonstration, notebooks/executed/demo.html: one page that needs nothing but a browser
.build/demo: .build/data $(MODEL) $(STUDY) $(addprefix homing_lib/publish/,demo.py style.py) \
  $(wildcard notebooks/demo/*) environment.lock
	$(HOMING) demo
	@cksum notebooks/executed/demo.html > $@

site: .build/pages ## all of it as pages to read from disk: open .build/site/index.html
.build/pages: $(EXECUTED) .build/demo .build/report homing_lib/publish/site.py $(wildcard notebooks/site/*) \
  notebooks/TEACHING.md notebooks/lab.ipynb README.md figures/film.gif
	$(HOMING) site
	@find .build/site -type f -exec cksum {} + > $@

# The environment of a class packs it too, where that is the only one.
READY := $(firstword $(wildcard .venv/.ready .build/class/.ready) .venv/.ready)
lab: .build/lab/lab-teacher.zip ## the lab for a class, .build/lab: lab.zip for students, lab-teacher.zip with the solutions
	@echo .build/lab/lab.zip && echo $<
.build/lab/lab-teacher.zip: $(MODEL) homing_lib/__main__.py $(STUDY) \
  $(wildcard homing_lib/publish/*.* homing_lib/teach/*.*) notebooks/lab.ipynb \
  $(wildcard notebooks/lab/* data/STUDIES.md LICENSE) pyproject.toml environment.lock | $(READY)
	$(READY:.ready=bin/python) -m homing_lib lab > /dev/null

# Work on the project itself
test: .venv/.ready ## lint, types and the quick tests
	.venv/bin/python -m ruff check
	.venv/bin/python -m ruff format --check
	.venv/bin/python -m mypy
	.venv/bin/python -m pytest -q -n 2 --dist loadfile

bench: .venv/.ready ## what a step and a run cost, in one table
	.venv/bin/python -m tests.bench

compact: .venv/.ready ## write the atlas that ships with the library, homing_lib/compact.atlas, anew
	.venv/bin/python -m homing_lib.publish.compact

# The second holds what the first does not.
locked = .build/lock/bin/uv pip compile -q pyproject.toml --universal --python-version 3.11 --only-binary :all: \
  --no-binary pybullet --generate-hashes --no-header --no-emit-index-url --no-emit-find-links
lock: ## write environment.lock and .ci/deep.lock anew from pyproject.toml
	$(PYTHON) -m venv .build/lock
	.build/lock/bin/python -m pip install -qq uv
	$(locked) --extra dev --extra camera -o environment.lock
	$(locked) --extra deep -c environment.lock -o .ci/deep.lock \
	  $$(sed -n 's/^\([a-z0-9.-]*\)==.*/--no-emit-package \1/p' environment.lock)

clean: ## forget what was built; data and figures stay
	rm -rf .build paper/numbers.tex

help:
	@awk -F ':.*## ' '/^[a-z]+:.* ## / { printf "make %-9s %s\n", $$1, $$2 }' Makefile

FORCE:
