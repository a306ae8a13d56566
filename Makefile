# The whole project on one page. A target stands left of the colon, what it is made from stands right.
#
#   make             everything: environment, data, live check, notebooks, figures, paper/report.pdf
#   make test        lint, types and the quick tests
#   make data        check the stored runs, compute the missing ones (all of them: make data FORCE=1)
#   make verify      repeat one stored run live and compare it to the bit
#   make notebooks   execute the notebooks; they write figures/ and notebooks/executed/
#   make quick       the same in some minutes and into .build/quick, for trying changes out
#   make paper       the report
#   make lectures    two lectures on slides and their notes, .build/lectures/*.pdf
#   make demo        the demonstration, notebooks/executed/demo.html: one page that needs nothing but a browser
#   make site        all of it as pages to read from disk: open .build/site/index.html
#   make lab         the lab for a class: .build/lab/lab.zip for students, lab-teacher.zip with the solutions
#   make bench       what learning reaches and costs, in one table
#   make class       open the notebooks in JupyterLab, on any computer: no compiler, no LaTeX
#   make compact     write the atlas that comes along, homing_lib/compact.atlas, anew
#   make lock        write environment.lock anew from pyproject.toml
#   make clean       forget what was built; data and figures stay

# The first that is there; `make PYTHON=python3.13` takes another, and makes .venv anew.
found   = $(shell python$(1) -c 'print("python$(1)")' 2>/dev/null)
PYTHON ?= $(or $(call found,3.11),$(call found,3.12),$(call found,3.13),python3.11)
VENV   := .venv/bin/python
HOMING := $(VENV) -m homing_lib

LIBRARY   := $(wildcard homing_lib/*.py homing_lib/*/*.py homing_lib/*.toml homing_lib/*/*.toml)
NOTEBOOKS := $(patsubst notebooks/%.ipynb,%,$(wildcard notebooks/[0-9]*.ipynb))
LECTURES  := $(patsubst paper/lectures/%.tex,%,$(filter-out %/preamble.tex,$(wildcard paper/lectures/*.tex)))

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

# Before all else: a stamp goes when a file that it lists is not as it was written, so that the file is made again; so
# does a folder in a stamp's place.
$(shell for stamp in .build/data .build/verified .build/numbers .build/demo .build/pages .build/notebooks/*; do \
  [ ! -d "$$stamp" ] || rm -rf "$$stamp"; done)
$(shell for stamp in $(wildcard .build/numbers .build/demo .build/pages .build/notebooks/*); do \
  cut -d ' ' -f 3- "$$stamp" | while read -r file; do cksum "$$file"; done 2>/dev/null | cmp -s - "$$stamp" || \
  rm -f "$$stamp"; done)
$(shell cmp -s paper/report.pdf .build/paper/report.pdf || rm -f .build/paper/report.pdf)

# Two at a time, notebooks above all.
MAKEFLAGS += --jobs=2

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.PHONY: all test data verify notebooks quick paper lectures demo site lab bench class compact lock clean help FORCE

all: .build/summary paper/report.pdf .build/demo
	@cat $<
	@echo "Report: paper/report.pdf"


### Environment: exactly the locked packages, then this one

PIP     := -m pip install -qq --disable-pip-version-check
VERSION := $(shell $(PYTHON) -c 'import ensurepip, sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
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

class: .build/class/.ready
	$(if $(OPEN),env -u MPLBACKEND .build/class/bin/jupyter $(OPEN) notebooks)


### Data: always checked (a second), newer only if its content changed

.build/data: FORCE | .venv/.ready
	@mkdir -p .build
	$(HOMING) data --stamp $@$(if $(FORCE), --force)

.build/verified: .build/data $(LIBRARY) $(if $(filter verify,$(MAKECMDGOALS)),FORCE)
	$(HOMING) verify | tee $@.part
	@mv $@.part $@

.build/summary: .build/verified .build/data $(LIBRARY)
	$(HOMING) summary > $@.part
	@mv $@.part $@


### Notebooks: the stamp of each lists the files that it wrote, with their checksums

.build/notebooks/%: notebooks/%.ipynb .build/data $(LIBRARY) environment.lock
	@mkdir -p $(@D)
	$(HOMING) notebook $* > $@.part
	@while read -r file; do cksum "$$file"; done < $@.part > $@.sums
	@rm $@.part; mv $@.sums $@

.build/quick/%.ipynb: notebooks/%.ipynb .build/data $(LIBRARY) environment.lock
	$(HOMING) notebook $* --profile quick --output-dir .build/quick --figures-dir .build/quick/figures


### Report

.build/numbers: .build/data $(LIBRARY) paper/report.tex $(wildcard paper/lectures/*.tex) $(NOTEBOOKS:%=notebooks/%.ipynb)
	$(HOMING) numbers --latex > paper/numbers.tex.part
	@mv paper/numbers.tex.part paper/numbers.tex
	@cksum paper/numbers.tex > $@

# $(1): the PDF without its ending; $(2): further options. If it fails, what LaTeX says of it.
typeset = latexmk -cd -g -pdf -interaction=nonstopmode -halt-on-error $(2) $< > $(1).pdf.log 2>&1 || \
	  { grep -A 5 '^!' $(1).log || tail $(1).pdf.log; exit 1; } >&2

.build/paper/report.pdf: paper/report.tex .build/numbers $(NOTEBOOKS:%=.build/notebooks/%)
	@paper/install-tex.sh
	@mkdir -p $(@D)
	$(call typeset,$(@:.pdf=),-outdir=../$(@D))

paper/report.pdf: .build/paper/report.pdf
	@cp $< $@


### Two lectures: slides, and as a second PDF each slide with three lines for whom gives it

.build/lectures/%.pdf .build/lectures/%-notes.pdf: paper/lectures/%.tex paper/lectures/preamble.tex .build/numbers \
  $(NOTEBOOKS:%=.build/notebooks/%)
	@paper/install-tex.sh lectures
	@mkdir -p $(@D)
	$(call typeset,$(@D)/$*,-outdir=../../$(@D))
	$(call typeset,$(@D)/$*-notes,-outdir=../../$(@D) -jobname=$*-notes -usepretex='\def\withnotes{}')


### The demonstration

.build/demo: .build/data $(LIBRARY) $(wildcard notebooks/demo/* homing_lib/*.atlas) environment.lock
	$(VENV) -m homing_lib.publish.demo
	@cksum notebooks/executed/demo.html > $@


### The site

.build/pages: .build/data $(LIBRARY) $(wildcard notebooks/site/*) notebooks/lab.ipynb README.md figures/film.gif \
  environment.lock $(NOTEBOOKS:%=.build/notebooks/%) .build/demo paper/report.pdf
	$(VENV) -m homing_lib.publish.site
	@cksum .build/site/* > $@


### The lab: two archives

.build/lab/lab-teacher.zip: .build/data $(LIBRARY) notebooks/lab.ipynb $(wildcard notebooks/lab/*) environment.lock
	$(VENV) -m homing_lib.teach.handouts


### Names for the above

data: .build/data
verify: .build/verified
notebooks: $(NOTEBOOKS:%=.build/notebooks/%)
quick: $(NOTEBOOKS:%=.build/quick/%.ipynb)
paper: paper/report.pdf
lectures: $(LECTURES:%=.build/lectures/%.pdf) $(LECTURES:%=.build/lectures/%-notes.pdf)
demo: .build/demo
site: .build/pages
lab: .build/lab/lab-teacher.zip

test: .venv/.ready
	$(VENV) -m ruff check
	$(VENV) -m ruff format --check
	$(VENV) -m mypy
	$(VENV) -m pytest -q -n 2 --dist loadfile

bench: .venv/.ready
	$(VENV) -m tests.bench

lock:
	$(PYTHON) -m venv .build/lock
	.build/lock/bin/pip install -qq --disable-pip-version-check uv
	.build/lock/bin/uv pip compile -q pyproject.toml --extra dev --extra camera --universal --python-version 3.11 \
	  --only-binary :all: --no-binary pybullet --generate-hashes --no-header --no-emit-index-url --no-emit-find-links \
	  -o environment.lock

compact: .venv/.ready
	$(VENV) -m homing_lib.publish.compact

clean:
	rm -rf .build paper/numbers.tex

help:
	@sed -n 's/^#   //p' $(firstword $(MAKEFILE_LIST))

FORCE:
