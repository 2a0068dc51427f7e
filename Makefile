# README.md says what these commands do; the scripts are in .ci/.
.PHONY: reproduce check test verify book environment

reproduce: environment
	@.venv/bin/tbdcore run
	@.venv/bin/tbdcore score

check:
	@sh .ci/check

test:
	@sh .ci/test

verify:
	@sh .ci/verify

book:
	@sh .ci/book

environment:
	@sh .ci/environment
