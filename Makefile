# The whole project on one page. A target stands left of the colon, what it is made from stands right.
# `make help` prints what stands behind a ##.

# The first that is there; `make PYTHON=python3.13` takes another, and makes .venv anew.
works   = $(shell python$(1) -c 'print("python$(1)")' 2>/dev/null)
PYTHON ?= $(or $(call works,3.11),$(call works,3.12),$(call works,3.13),python3.11)
VERSION := $(shell $(PYTHON) -c 'import ensurepip, sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
VENV   := .venv/bin/python
HOMING := $(VENV) -m homing_lib
PIP    := -m pip install -qq --disable-pip-version-check

# The library, by who uses it, so that an edit remakes what it touches and nothing else. No notebook imports LETTERS,
# the lab or its handouts; a test compares this with their imports.
LETTERS := $(patsubst %,homing_lib/publish/%.py,cli compact demo film prose report site tex where)
MODEL   := $(filter-out %/__main__.py,$(wildcard homing_lib/*.*))
STUDY   := $(wildcard homing_lib/study/*.* homing_lib/study/[a-z]*/*.*)
DRAWING := $(filter-out $(LETTERS),$(wildcard homing_lib/publish/*.*))
TEACH   := $(filter-out %/lab.py %/handouts.py,$(wildcard homing_lib/teach/*.*))

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
unexport PYTHONPATH PYTHONHOME
# Nor anything of a user's own: LaTeX takes its packages from where it is installed.
export TEXMFHOME := /nonexistent
export TEXMFCONFIG := /nonexistent
export TEXMFVAR := /nonexistent
unexport TEXINPUTS TEXMFCNF TEXFONTMAPS

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS += --jobs=2
.DELETE_ON_ERROR:
.PHONY: all test data verify notebooks quick paper lectures demo site lab bench class compact lock clean help FORCE

# A stamp lists the files that were made, with their checksums. Before all else it goes, so that they are made again, if
# one is no longer so, or if a folder stands in its place.
LISTING := $(wildcard .build/numbers .build/report .build/demo .build/pages .build/notebooks/*)
$(shell for stamp in .build/data .build/verified $(LISTING); do [ ! -d "$$stamp" ] || rm -rf "$$stamp"; done; \
  for stamp in $(LISTING); do cut -d ' ' -f 3- "$$stamp" | while read -r file; do cksum "$$file"; done | \
  cmp -s - "$$stamp" || rm -f "$$stamp"; done 2>/dev/null)

all: .build/summary .build/report .build/demo ## everything: data, a live check, notebooks, figures, the report
	@cat $<
	@echo "Report: paper/report.pdf"


# Environment: exactly the locked packages, then this one.
COMPILE := $(filter-out 3.11-Linux-x86_64,$(VERSION)-$(shell uname -s)-$(shell uname -m))
.venv/.locked-$(VERSION): environment.lock
	@[[ "$(VERSION)" = 3.1[123] ]] || { echo \
	  "homing: '$(PYTHON)' is no Python 3.11, 3.12 or 3.13 with venv; on Debian: apt-get install python3.11-venv;" \
	  "elsewhere: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	rm -rf .venv
	$(PYTHON) -m venv .venv
	@$(if $(COMPILE),echo "PyBullet has no wheel for this Python: compiling it takes 7 minutes on two cores")
	$(VENV) $(PIP) --only-binary :all: $(if $(COMPILE),--no-binary pybullet) --require-hashes -r $<
	@touch $@

.venv/.ready: .venv/.locked-$(VERSION) pyproject.toml
	$(VENV) $(PIP) --no-deps --no-build-isolation -e .
	@touch $@

# For lessons: whatever packages this Python gets, and PyBullet only where it has a wheel. `OPEN=` opens nothing.
OPEN ?= lab
.build/class/.ready: pyproject.toml
	$(PYTHON) -m venv .build/class
	.build/class/bin/python $(PIP) -e .
	@touch $@

class: .build/class/.ready ## open the notebooks in JupyterLab, on any computer: no compiler, no LaTeX
	$(if $(OPEN),env -u MPLBACKEND .build/class/bin/jupyter $(OPEN) notebooks)

# Data: always checked, in two seconds. The stamp is newer only if their content changed.
data: .build/data ## check the stored runs, compute the missing ones (all of them: make data FORCE=1)
.build/data: FORCE | .venv/.ready
	@mkdir -p .build
	$(HOMING) data --stamp $@$(if $(FORCE), --force)

verify: .build/verified ## repeat one stored run live and compare it to the bit
.build/verified: .build/data $(MODEL) $(STUDY) $(if $(filter verify,$(MAKECMDGOALS)),FORCE)
	$(HOMING) verify | tee $@.part
	@mv $@.part $@

.build/summary: .build/verified $(STUDY) homing_lib/publish/report.py
	$(HOMING) summary > $@.part
	@mv $@.part $@

# Notebooks
notebooks: $(EXECUTED) ## execute the notebooks; they write figures/ and notebooks/executed/
.build/notebooks/%: notebooks/%.ipynb .build/data $(MODEL) $(STUDY) $(DRAWING) $(TEACH) environment.lock
	@mkdir -p $(@D)
	$(HOMING) notebook $* > $@.part
	@while read -r file; do cksum "$$file"; done < $@.part > $@.sums
	@rm $@.part; mv $@.sums $@

quick: $(NOTEBOOKS:%=.build/quick/%.ipynb) ## the same in some minutes and into .build/quick, for trying changes out
.build/quick/%.ipynb: notebooks/%.ipynb .build/data $(MODEL) $(STUDY) $(DRAWING) $(TEACH) environment.lock
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
.build/report: paper/report.tex .build/numbers $(EXECUTED)
	@paper/install-tex.sh
	@mkdir -p .build/paper
	$(call typeset,.build/paper/report,-outdir=../.build/paper)
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
.build/demo: .build/data $(MODEL) $(STUDY) $(DRAWING) homing_lib/publish/demo.py $(wildcard notebooks/demo/*) \
  environment.lock
	$(HOMING) demo
	@cksum notebooks/executed/demo.html > $@

site: .build/pages ## all of it as pages to read from disk: open .build/site/index.html
.build/pages: $(EXECUTED) .build/demo .build/report homing_lib/publish/site.py $(wildcard notebooks/site/*) \
  notebooks/lab.ipynb README.md figures/film.gif
	$(HOMING) site
	@find .build/site -type f -exec cksum {} + > $@

lab: .build/lab/lab-teacher.zip ## the lab for a class, .build/lab: lab.zip for students, lab-teacher.zip with the solutions
.build/lab/lab-teacher.zip: .build/data $(wildcard homing_lib/*.* homing_lib/*/*.* homing_lib/*/*/*.*) \
  notebooks/lab.ipynb $(wildcard notebooks/lab/*) environment.lock
	$(HOMING) lab

# Work on the project itself
test: .venv/.ready ## lint, types and the quick tests
	$(VENV) -m ruff check
	$(VENV) -m ruff format --check
	$(VENV) -m mypy
	$(VENV) -m pytest -q -n 2 --dist loadfile

bench: .venv/.ready ## what learning reaches and costs, in one table
	$(VENV) -m tests.bench

lock: ## write environment.lock anew from pyproject.toml
	$(PYTHON) -m venv .build/lock
	.build/lock/bin/pip install -qq --disable-pip-version-check uv
	.build/lock/bin/uv pip compile -q pyproject.toml --extra dev --extra camera --universal --python-version 3.11 \
	  --only-binary :all: --no-binary pybullet --generate-hashes --no-header --no-emit-index-url --no-emit-find-links \
	  -o environment.lock

compact: .venv/.ready ## write the atlas that comes along, homing_lib/compact.atlas, anew
	$(VENV) -m homing_lib.publish.compact

clean: ## forget what was built; data and figures stay
	rm -rf .build paper/numbers.tex

help:
	@sed -n 's/^\([a-z]*\):.* ## /\1\t/p' $(firstword $(MAKEFILE_LIST)) | expand -t 14 | sed 's/^/make /'

FORCE:
