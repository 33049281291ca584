#pragma once

#include "driver/board_kit.hpp"
