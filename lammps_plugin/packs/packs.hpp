#pragma once

// Of every shape that has packs: without its header it would have none.
#include "packs/packs_of.hpp"
#include "packs/rods.hpp"
