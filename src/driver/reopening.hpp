#pragma once

#include "driver/own_handle_writer.hpp"
